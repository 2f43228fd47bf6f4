"""Hands in a video: detection by MediaPipe, tracking over the whole video, repair."""

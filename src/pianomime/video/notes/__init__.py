"""Which notes are played in a video, and by which fingers."""

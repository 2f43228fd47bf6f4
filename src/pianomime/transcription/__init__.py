"""Transcription: the notes and the pedal of a piano, written down from its sound."""

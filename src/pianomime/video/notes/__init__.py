"""Notes in a video: from a MIDI file or from the keys, and the finger that plays each note."""

"""PianoMime: give it a song, and two simulated robot hands play it."""

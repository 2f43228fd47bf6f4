"""Where the keyboard is in a video."""

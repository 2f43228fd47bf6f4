"""Where the hands are in a video."""

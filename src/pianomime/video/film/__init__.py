"""Video files: frames at a steady rate, and a record on disk of what was read in each."""

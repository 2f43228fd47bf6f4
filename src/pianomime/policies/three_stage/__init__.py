"""Three stages: from goals to fingers, on to fingertips, and on to controls."""

"""Training of the three stages: fingering, motion of the hands, controls of the hands."""

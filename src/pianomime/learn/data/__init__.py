"""Data sets for imitation learning: episodes, DAgger, samples."""

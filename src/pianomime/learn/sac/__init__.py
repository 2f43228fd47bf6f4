"""Multi-task reinforcement learning: one policy for all songs, without demonstrations (SAC)."""

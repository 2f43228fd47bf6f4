"""Multi-task SAC: one policy for all songs by reinforcement learning, without demonstrations."""

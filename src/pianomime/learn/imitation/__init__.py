"""Imitation learning: networks, training loop and export of policies (paper, appendices E to G)."""

"""The goal autoencoder: from the keys that should be down to 16 numbers (paper, appendix E)."""

"""Goal autoencoder: the keys that should be down as a code of 16 numbers (paper, appendix E)."""

"""How players of every song learn from data (paper, appendices E to G)."""

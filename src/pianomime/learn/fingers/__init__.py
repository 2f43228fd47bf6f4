"""How the residual that all fingers share is learned, on many songs at once."""

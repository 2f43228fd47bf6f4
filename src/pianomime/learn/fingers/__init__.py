"""Training of the finger residual: one policy for all fingers, by PPO on many songs."""

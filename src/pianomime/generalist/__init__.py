"""Players of every song that have learned from data, as they are played: without torch.

How they learn is in `pianomime.learn.generalist`.
"""

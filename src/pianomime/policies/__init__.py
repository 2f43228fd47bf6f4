"""Learned policies as they are played: NumPy and ONNX Runtime, no torch.

`pianomime.learn` trains them.
"""

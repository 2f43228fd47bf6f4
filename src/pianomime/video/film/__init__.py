"""The video file: decoded frames, read ahead, and the light on keys that is kept of them."""

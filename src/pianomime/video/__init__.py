"""From a video of somebody playing to a Demonstration."""

"""Positions of the world's keys in world x, y, which pictures of a keyboard are matched with."""

from __future__ import annotations

import numpy as np

from pianomime.keyboard import BLACK
from pianomime.world.parameters import key_centres, key_half_sizes

WHITE_WIDTH = 0.0235
"""[m] Distance between neighbouring white keys."""
WHITES = np.flatnonzero(~BLACK)
"""(52,) The white keys, bass to treble."""
FAR, FRONT = -0.075, 0.075
"""[m] World x of the two ends of the white keys, away from the player and toward the player."""
BLACK_FRONT = float(key_centres()[1, 0] + key_half_sizes()[1, 0])
"""[m] World x of the end of the black keys toward the player."""
LEFT_EDGE = float(key_centres()[0, 1]) - WHITE_WIDTH / 2
"""[m] World y of the left edge of the lowest key."""

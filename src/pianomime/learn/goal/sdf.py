"""Distance to the nearest key of a goal (paper, appendix E, equation 2)."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from pianomime.world.parameters import key_centres, key_half_sizes

KEYBOARD_LENGTH = float(key_centres()[-1, 1] - key_centres()[0, 1] + 2 * key_half_sizes()[0, 1])
"""[m] Length of the keyboard, 1.221. Distances are clipped to it, and it is the distance to a goal
without keys. Networks have distances in this unit, 0 to 1."""

QUERY_LOW = np.array([-0.1, -KEYBOARD_LENGTH / 2, 0.0])
QUERY_HIGH = np.array([0.1, KEYBOARD_LENGTH / 2, 0.1])
"""(3,) [m] Corners of the box about the keyboard in which fingertips are, and queries sampled."""


def distance(goal: Tensor, query: Tensor) -> Tensor:
    """Distance from points to the nearest key of a goal, at most `KEYBOARD_LENGTH`.

    The position of a key is its middle at rest. The paper calls this a signed distance function; it
    is never negative.

    Args:
        goal: (..., 88) more than 0.5 for keys that should be down.
        query: (..., 3) positions in the world frame [m]; the shapes of both broadcast.

    Returns:
        (...) [m], in the precision of the queries.
    """
    centres = torch.tensor(key_centres(), dtype=query.dtype, device=query.device)
    # Computed by matrix products, it would be a millimetre off close to a key.
    apart = torch.cdist(
        query.reshape(-1, 3), centres, compute_mode="donot_use_mm_for_euclid_dist"
    ).reshape(*query.shape[:-1], len(centres))
    nearest = torch.where(goal > 0.5, apart, KEYBOARD_LENGTH).amin(dim=-1)
    return nearest.clamp(max=KEYBOARD_LENGTH)


def chamfer(goal: Tensor) -> Tensor:
    """Chamfer distance of goals: from a key of one to the nearest key of the other, on average.

    Args:
        goal: (N, 88) more than 0.5 for keys that should be down, one of each goal at least.

    Returns:
        (N, N) [m], symmetric: the mean of both ways.
    """
    centres = torch.tensor(key_centres(), dtype=goal.dtype, device=goal.device)
    down = (goal > 0.5).to(goal.dtype)
    to_goal = distance(goal[:, None], centres)
    one_way = (down / down.sum(dim=1, keepdim=True)) @ to_goal.T
    return (one_way + one_way.T) / 2

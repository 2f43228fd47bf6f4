"""Feedback of fingertips: joint displacements that bring fingers to where they should be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_LIFT_DAMPING = 0.01
"""[m/rad] Damping of the lift: joints that raise a fingertip by less hardly move."""


def reach_joints(
    jacobian: NDArray[np.float64], error: NDArray[np.float64], limit: float, damping: float
) -> NDArray[np.float64]:
    """(..., 27) Joint displacement that reduces the errors of the fingertips of hands [rad, m].

    Args:
        jacobian: (..., 5, 3, 27) of the fingertips.
        error: (..., 5, 3) from where they are to where they should be [m].
        limit: errors are clipped to this length [m].
        damping: of the inversion [m/rad].
    """
    size = np.linalg.norm(error, axis=-1, keepdims=True)
    error = error * np.minimum(1.0, limit / np.maximum(size, 1e-9))
    transposed = jacobian.swapaxes(-1, -2)
    gram = jacobian @ transposed + damping**2 * np.eye(3)
    force = np.linalg.solve(gram, error[..., None])
    move: NDArray[np.float64] = (transposed @ force).sum(axis=-3)[..., 0]
    return move


def lift_joints(upward: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """(27,) Joint displacement that lifts F fingers [rad, m].

    Args:
        upward: (F, 27) their vertical Jacobian.
        height: by which they are lifted [m].
    """
    strength = (upward**2).sum(axis=1, keepdims=True) + _LIFT_DAMPING**2
    lift: NDArray[np.float64] = (height * upward / strength).sum(axis=0)
    return lift


def shared(error: NDArray[np.float64]) -> float:
    """The part of the errors of F pressing fingers that the forearm corrects [m].

    Stretched fingers are at the end of what their joints can do: only the forearm can help them,
    all alike. Of the error of a single finger it corrects half.
    """
    return float(error.sum()) / (len(error) + 1)

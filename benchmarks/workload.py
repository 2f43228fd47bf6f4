"""Controls for the speed benchmarks: hands that move and press keys."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Mean and standard deviation of the control of each actuator [rad, m], rounded, over performances
# of experts with this hand; all fingers but the thumb share those of their last joints.
_POSTURE = {
    "WRJ2": (-0.23, 0.19),
    "WRJ1": (0.09, 0.14),
    "THJ5": (0.0, 0.55),
    "THJ4": (0.58, 0.24),
    "THJ3": (-0.04, 0.13),
    "THJ2": (0.0, 0.40),
    "THJ1": (0.40, 0.55),
    "LFJ5": (0.11, 0.15),
    "FFJ4": (-0.2, 0.18),
    "MFJ4": (-0.02, 0.15),
    "RFJ4": (0.0, 0.15),
    "LFJ4": (-0.2, 0.18),
    "J3": (0.07, 0.33),
    "J0": (1.75, 0.68),
    "forearm_tx": (-0.08, 0.10),
    "forearm_ty": (0.01, 0.03),
    "forearm_tz": (-0.026, 0.016),
}
_SLOWEST, _FASTEST = 0.7, 1.6  # [Hz] of fingers; those of forearms are a third
_GOLDEN = 0.6180339887498949


def waving(names: list[str], frames: int, dt: float) -> NDArray[np.float64]:
    """Controls of actuators that swing about a mean, each at a frequency of its own.

    Args:
        names: names of the actuators, which end with those of their joints.
        frames: number of control steps.
        dt: length of a control step [s].

    Returns:
        (frames, len(names)) targets [rad, m].
    """
    time = np.arange(frames) * dt
    controls = np.empty((frames, len(names)))
    for index, name in enumerate(names):
        suffix = next(suffix for suffix in _POSTURE if name.endswith(suffix))
        middle, spread = _POSTURE[suffix]
        # Multiples of the golden ratio are spread evenly, and no two are alike.
        share = (index * _GOLDEN) % 1.0
        frequency = _SLOWEST + (_FASTEST - _SLOWEST) * share
        if "forearm" in name:
            frequency /= 3.0
        swing = np.sin(2.0 * np.pi * (frequency * time + (index * _GOLDEN**2) % 1.0))
        controls[:, index] = middle + np.sqrt(2.0) * spread * swing
    return controls

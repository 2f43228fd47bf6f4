"""Sizes of a policy network's inputs and outputs."""

from __future__ import annotations

from typing import NamedTuple


class NetworkShape(NamedTuple):
    """Sizes of a network's inputs and its output.

    Attributes:
        frames: G, frames ahead in the observation.
        channels: C, features of each of them: goal code and further features.
        vector: V, features of the present frame.
        chunk: T, frames of actions.
        action: D, numbers of the action for one frame.
    """

    frames: int
    channels: int
    vector: int
    chunk: int
    action: int

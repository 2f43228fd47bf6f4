"""How much a network is given and says."""

from __future__ import annotations

from typing import NamedTuple


class Sizes(NamedTuple):
    """Of a network's inputs and its output.

    Attributes:
        frames: frames ahead that are seen.
        channels: numbers seen of each.
        vector: numbers seen besides.
        chunk: frames that are said.
        width: numbers said of each.
    """

    frames: int
    channels: int
    vector: int
    chunk: int
    width: int

"""Names of the worlds, that is, of the physics in which hands play; cheap to import."""

from __future__ import annotations

from typing import Literal, get_args

WorldName = Literal["paper", "solid"]

WORLDS: tuple[WorldName, ...] = get_args(WorldName)
"""The paper's world, in which hands pass through each other; and one in which they are solid, and
what moves them has limits."""
PAPER: WorldName = "paper"
"""The world of everything that is to compare with the paper."""
SOLID: WorldName = "solid"

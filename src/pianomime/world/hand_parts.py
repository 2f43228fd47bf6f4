"""Parts of the hands: sides, fingers, and the part to which a body of the model belongs."""

from __future__ import annotations

from typing import Literal, NamedTuple

Side = Literal["rh", "lh"]

SIDES: tuple[Side, Side] = ("lh", "rh")
"""The sides in plan order (left, right)."""
FINGER_PREFIXES = ("th", "ff", "mf", "rf", "lf")
"""Prefixes of the fingers' names in the model, thumb first."""
PALM = ""
"""What is no finger: forearm, wrist, palm, and the metacarpal of the little finger."""
_METACARPAL = "lfmetacarpal"
"""A body of the palm, though its name begins as the little finger's do."""


class Part(NamedTuple):
    """A part of a hand.

    Attributes:
        side: "lh" or "rh".
        finger: prefix of the finger that it is, which begins at its knuckle; or `PALM`.
    """

    side: str
    finger: str


PARTS = tuple(Part(side, finger) for side in SIDES for finger in (*FINGER_PREFIXES, PALM))
"""All parts of both hands."""


def part_of(body: str) -> Part | None:
    """The part to which a body belongs; None for one that is of no hand.

    Args:
        body: its name in the model.
    """
    side, _, name = body.partition("_")
    if side not in SIDES:
        return None
    if name == _METACARPAL:
        return Part(side, PALM)
    finger = next((finger for finger in FINGER_PREFIXES if name.startswith(finger)), PALM)
    return Part(side, finger)


def apart(one: Part, other: Part) -> bool:
    """Whether two parts should not be inside each other: of two hands, or two fingers of one."""
    if one.side != other.side:
        return True
    return one.finger != other.finger and PALM not in (one.finger, other.finger)

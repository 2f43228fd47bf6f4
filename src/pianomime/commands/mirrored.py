"""The flags --mirrored and --not-mirrored, of which at most one is given."""

from __future__ import annotations

from pianomime.errors import InputError


def mirrored_or_not(mirrored: bool, not_mirrored: bool) -> bool | None:
    """Whether a picture is mirrored; None if it is to be found out.

    Args:
        mirrored: whether --mirrored is given.
        not_mirrored: whether --not-mirrored is given.

    Raises:
        InputError: both are.
    """
    if mirrored and not_mirrored:
        raise InputError("--mirrored and --not-mirrored exclude each other")
    return mirrored if mirrored or not_mirrored else None

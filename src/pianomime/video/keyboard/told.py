"""Names of keys that a user told, and those that a picture allows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pianomime.video.keyboard.keyboard import Keyboard, find_keyboards


def named_as_told(
    keyboards: Sequence[Keyboard],
    picture: NDArray[np.float32],
    octave: int | None,
    mirrored: bool | None,
) -> list[Keyboard]:
    """The keyboard in each way to name its keys that agrees with what a user told.

    Args:
        keyboards: the keyboard in each way that the picture allows, the likeliest first.
        picture: (height, width) brightness, 0..1, in which it was found.
        octave: octave of the lowest C that is seen, 4 for the middle C, if it was told.
        mirrored: whether the picture is mirrored, if that was told.

    Returns:
        Those of `keyboards` that agree. If none does, what is told contradicts the picture, and
        they are those that come nearest to it; none if what is told is out of the question.
    """
    agree = [
        keyboard
        for keyboard in keyboards
        if octave in (None, keyboard.lowest_c) and mirrored in (None, keyboard.mirrored)
    ]
    if agree or (octave, mirrored) == (None, None):
        return agree
    return find_keyboards(picture, octave, mirrored)

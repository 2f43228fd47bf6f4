"""What a listener must be, which hears the notes in a stretch of sound; and where there is one."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.installation import install_command
from pianomime.music.score import Score


class Listener(Protocol):
    """Hears the notes of a piano.

    Attributes:
        rate: samples per second of what it hears [Hz].
    """

    rate: int

    def hear(self, samples: NDArray[np.float32], heard: Callable[[float], None]) -> Score:
        """The notes in a stretch of sound.

        Args:
            samples: (S,) about -1..1.
            heard: called now and then with how much of it has been heard [s].

        Returns:
            Notes and pedal, in the time of the stretch.
        """


def check_listener() -> None:
    """Refuse to begin where the network that hears notes is not installed.

    Raises:
        InputError: the message says what to install.
    """
    if not can_listen():
        raise InputError(f"transkun is needed to hear notes: {install_command('audio')}")


def can_listen() -> bool:
    """Whether the network that hears notes is installed."""
    return find_spec("transkun") is not None and find_spec("torch") is not None


def find_listener() -> Listener:
    """Load the network that hears notes.

    Raises:
        InputError: it is not installed, or does not load; the message says what to install.
    """
    check_listener()
    try:
        # The only file here that imports torch, which takes seconds.
        from pianomime.transcription.transkun import Transkun

        return Transkun()
    except ImportError as error:
        raise InputError(
            f"transkun does not load here ({error}): {install_command('audio')}"
        ) from error

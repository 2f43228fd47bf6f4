"""Costs of controls that are rolled out: what every cost offers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from pianomime.track.heard import Frame, Strike


class Tally(Protocol):
    """The cost of some frames, as they are heard."""

    def add(self, frame: Frame) -> None:
        """What is heard in the next frame."""

    @property
    def least(self) -> float:
        """What the frames cost at least, whatever is heard after them."""

    def total(self) -> float:
        """What they cost if nothing is heard after them."""


class Cost(Protocol):
    """The cost of what is heard, given what was heard before."""

    @property
    def short(self) -> float:
        """Cost of a key that is all the way from where it should be at the end of a frame.

        Less in proportion: keys that are nearly right are better.
        """

    def heard(self, strikes: Sequence[Strike]) -> None:
        """Remember what has sounded for good."""

    def of(
        self, first: int, frames: Sequence[Frame], count: int
    ) -> tuple[float, list[tuple[int, int]]]:
        """The cost of some frames, and what goes wrong in them.

        Args:
            first: number of the first frame.
            frames: what is heard in it and in those that follow.
            count: of the frames that count; later ones only show what still comes.

        Returns:
            The cost; and what goes wrong, as frames counted from the first, and keys.
        """

    def tally(self, first: int) -> Tally:
        """The cost of frames that are added one after the other.

        Args:
            first: number of the first frame.
        """

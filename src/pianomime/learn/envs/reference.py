"""What an expert is trained on: a score and the fingertip plan that goes with it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import EXCERPT_SECONDS, FRAME_RATE, KEYS
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.plan.demonstration import Demonstration
from pianomime.short_repr import short_repr
from pianomime.songs.find import find_song

MIN_FRAMES = round(FRAME_RATE)
"""Frames of the shortest song that anything can be learned on: one second."""


@dataclass(frozen=True, eq=False)
class Reference:
    """What is to be played, frame by frame; T frames.

    Attributes:
        goal: (T, 88) bool, the keys that should sound after each frame.
        pedal: (T,) bool, whether the pedal should be down in each frame.
        plan: where the fingertips should be.
    """

    goal: NDArray[np.bool_]
    pedal: NDArray[np.bool_]
    plan: FingertipPlan

    __repr__ = short_repr

    @classmethod
    def of(cls, demonstration: Demonstration) -> Reference:
        """The frames of a demonstration."""
        score = demonstration.score
        return cls(score.roll(), score.pedal_roll(), demonstration.plan)

    def __len__(self) -> int:
        """Number of frames, T."""
        return len(self.goal)

    def goals(self, frames: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(..., 88) bool, the goals of frames (...); silence from the end of the song on."""
        return self._padded_goal[np.minimum(frames, len(self))]

    def targets(self, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        """(..., 2, 6, 3) [m] the plan's targets of frames (...); the last ones from the end on.

        Hands are (left, right), points wrist and fingertips, thumb first; world frame.
        """
        return self.plan.fingertips[np.minimum(frames, len(self) - 1)]

    @cached_property
    def _padded_goal(self) -> NDArray[np.bool_]:
        return np.vstack([self.goal, np.zeros((1, KEYS), bool)])


def load_demonstration(
    name: str | Path, start: float = 0.0, seconds: float = EXCERPT_SECONDS
) -> Demonstration:
    """An excerpt of a demonstration, or of a song with the plan of the zero-shot planner.

    Args:
        name: a demonstration (.npz), a MIDI file, or the name of a bundled song.
        start: where to begin [s].
        seconds: length at most [s].

    Raises:
        InputError: it is none of these, or nothing can be learned on it.
    """
    if Path(name).suffix == ".npz":
        demonstration = Demonstration.load(name).excerpt(start, seconds)
    else:
        score = load_score(name, start, seconds)
        # Files hold no joints: what is learned must be the same after it was saved and read.
        plan = replace(ZeroShotPlanner().plan(score), joints=None)
        demonstration = Demonstration(score, plan, source="zero-shot plan")
    check_demonstration(demonstration, str(name))
    return demonstration


def load_score(name: str | Path, start: float, seconds: float) -> Score:
    """The score of what `load_demonstration` would load.

    Args:
        name: a demonstration (.npz), a MIDI file, or the name of a bundled song.
        start: where to begin [s].
        seconds: length at most [s].

    Raises:
        InputError: it is none of these.
    """
    if Path(name).suffix == ".npz":
        return Demonstration.load(name).excerpt(start, seconds).score
    return excerpt(Score.from_midi(find_song(str(name))), start, seconds)


def check_demonstration(demonstration: Demonstration, name: str) -> None:
    """Refuse a demonstration on which nothing can be learned.

    Args:
        demonstration: to check.
        name: what the message calls it.

    Raises:
        InputError: it is shorter than a second, silent, or no finger presses a key.
    """
    frames = len(demonstration.plan)
    if frames < MIN_FRAMES:
        raise InputError(
            f"{name}: lasts {frames / FRAME_RATE:.2f} s; a song takes a second at least"
        )
    if not len(demonstration.score):
        raise InputError(f"{name}: has no notes")
    if not (demonstration.plan.finger_key >= 0).any():
        raise InputError(f"{name}: no finger presses a key in it")

"""Demonstration: a score with the fingertips of a human who played it."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.archive import read_archive, write_arrays
from pianomime.errors import InputError
from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE, NO_KEY
from pianomime.music import Score
from pianomime.plan import FingertipPlan

TRAIN = "train"
"""The split of what is for training."""
_VERSION = 1
_SCORE = ("key", "onset", "offset", "velocity", "pedal")
_PLAN = ("fingertips", "finger_key", "note_hand", "note_finger")


@dataclass(frozen=True, eq=False)
class Demonstration:
    """What a video, or a data set, tells of how a human played something.

    Attributes:
        score: what was played; time 0 is the first frame of the plan.
        plan: where the human's fingertips were, and what they pressed; a row for each frame of
            `score.roll()`.
        source: name of the video or data set.
        homography: (3, 3) from the video's pixels to world x, y [m]; all NaN if unknown.
        quality: figures that tell how good the source was: names to numbers, texts or lists.
        song: number that demonstrations of one song share; -1 where nobody knows.
        split: part of its data set that it belongs to; only "train" is for training.
    """

    score: Score
    plan: FingertipPlan
    source: str = ""
    homography: NDArray[np.float64] = field(default_factory=lambda: np.full((3, 3), np.nan))
    quality: dict[str, Any] = field(default_factory=dict)
    song: int = -1
    split: str = TRAIN

    def __post_init__(self) -> None:
        if len(self.plan) != self.score.frames():
            raise ValueError(f"{len(self.plan)} rows of a plan for {self.score.frames()} frames")
        if len(self.plan.note_hand) != len(self.score):
            raise ValueError("the plan is not one for the notes of the score")

    def excerpt(self, start: float = 0.0, seconds: float = 30.0) -> Demonstration:
        """The part from the first sound at or after `start`, cut between frames.

        Args:
            start: where to begin looking for the first note [s].
            seconds: length at most [s]; may be infinite.

        Raises:
            InputError: a time is out of range, or nothing sounds after `start`.
        """
        if not seconds > 0:
            raise InputError(f"seconds must be more than 0, not {seconds:g}")
        if not 0 <= start < self.score.duration:
            raise InputError(
                f"nothing to play from {start:g} s on: {self.score.title} lasts "
                f"{self.score.duration:.1f} s"
            )
        score = self.score
        sounding = np.maximum(score.onset[score.offset > start], start)
        first = int(np.floor((sounding.min() if len(sounding) else start) * FRAME_RATE))
        last = min(first + seconds * FRAME_RATE, float(score.frames()))
        end = int(last)
        begins, ends = first / FRAME_RATE, max(end, first + 1) / FRAME_RATE
        inside = (score.onset < ends) & ((score.offset > begins) | (score.onset >= begins))
        onset = np.maximum(score.onset[inside], begins) - begins
        part = on_grid(score.clip(begins, ends))
        order = np.lexsort((score.key[inside], onset))
        rows = np.minimum(np.arange(first, first + part.frames()), len(self.plan) - 1)
        finger_key = self.plan.finger_key[rows]
        # A piece that ends with a frame has one more, silent, row.
        finger_key[first + np.arange(len(rows)) >= end] = NO_KEY
        plan = FingertipPlan(
            self.plan.fingertips[rows],
            finger_key,
            self.plan.note_hand[inside][order],
            self.plan.note_finger[inside][order],
        )
        return replace(self, score=part, plan=plan)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to one .npz file, whole or not at all.

        Args:
            path: where to; its folder must exist.
        """
        arrays: dict[str, NDArray[np.generic]] = {
            "demonstration_version": np.array(_VERSION),
            "source": np.array(self.source),
            "score_title": np.array(self.score.title),
            "homography": self.homography,
            "quality": np.array(json.dumps(self.quality)),
            "song": np.array(self.song),
            "split": np.array(self.split),
        }
        for name in _SCORE:
            arrays[f"score_{name}"] = getattr(self.score, name)
        for name in _PLAN:
            arrays[f"plan_{name}"] = getattr(self.plan, name)
        with atomic(path) as temporary:
            write_arrays(temporary, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Demonstration:
        """Read what `save` wrote.

        Raises:
            OSError: there is no such file, or it cannot be read.
            InputError: no demonstration, or one of a version that we do not know.
        """
        return read_archive(
            path, "a demonstration", ("demonstration_version", _VERSION), cls._from_arrays
        )

    @classmethod
    def _from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> Demonstration:
        return cls(
            Score(
                **{name: arrays[f"score_{name}"] for name in _SCORE},
                title=str(arrays["score_title"]),
            ),
            FingertipPlan(**{name: arrays[f"plan_{name}"] for name in _PLAN}),
            str(arrays["source"]),
            arrays["homography"],
            json.loads(str(arrays["quality"])),
            # Not in files of older programs.
            int(arrays.get("song", -1)),
            str(arrays.get("split", TRAIN)),
        )


@dataclass(frozen=True)
class DemonstrationPlanner:
    """The planner that knows one score, and how a human played it.

    Attributes:
        demonstration: what it knows.
    """

    demonstration: Demonstration

    def plan(self, score: Score) -> FingertipPlan:
        """The human's plan.

        Raises:
            InputError: the score is another one.
        """
        known = self.demonstration.score
        if score is not known and not np.array_equal(score.roll(), known.roll()):
            raise InputError(f"{score.title}: not the score of the demonstration {known.title}")
        return self.demonstration.plan


def on_grid(score: Score) -> Score:
    """The same score with times that are almost those of a frame put right on it.

    Otherwise the rounding of a sum decides in which frame a note begins.
    """

    def snap(times: NDArray[np.float64]) -> NDArray[np.float64]:
        frame = np.rint(times * FRAME_RATE)
        return np.where(np.abs(times * FRAME_RATE - frame) < 1e-5, frame / FRAME_RATE, times)

    return replace(
        score, onset=snap(score.onset), offset=snap(score.offset), pedal=snap(score.pedal)
    )

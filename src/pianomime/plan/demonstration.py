"""Demonstration: a Score with a FingertipPlan that plays it, and where the plan came from."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.archive import holds, read_archive, write_arrays
from pianomime.errors import InputError
from pianomime.files import atomic
from pianomime.keyboard import EXCERPT_SECONDS, FRAME_RATE, NO_KEY
from pianomime.music import Score
from pianomime.plan.fingertip_plan import FingertipPlan
from pianomime.plan.hand_path import make_feasible
from pianomime.plan.plan_arrays import (
    PLAN_SCHEMA,
    SCORE_SCHEMA,
    plan_arrays,
    plan_of,
    score_arrays,
    score_of,
)
from pianomime.schema import Field, check_json
from pianomime.sealed_json import parse_json
from pianomime.short_repr import count, short_repr

TRAIN = "train"
"""Name of the split that is used for training."""
_MARK = "demonstration_version"
"""The array that marks the file, which holds its version."""
_VERSION = 2
"""Of the file; version 1 had no digest."""
_SCHEMA = {
    "source": Field("text"),
    "homography": Field("float", (3, 3), may_be_nan=True),
    "quality": Field("text"),
    "song_id": Field("int", (), -1),
    "split": Field("text"),
    **SCORE_SCHEMA,
    **PLAN_SCHEMA,
}


@dataclass(frozen=True, eq=False)
class Demonstration:
    """A score and one way to play it: that of a human in a video, or of a planner.

    Experts are trained to follow it, and learned policies to imitate it.

    Attributes:
        score: the notes that are played; time 0 is the first frame of the plan.
        plan: where the fingertips are and which keys they press, with a row for each frame of
            `score.roll()`.
        source: what the plan was made from: the name of a video, of a data set or of a planner.
        homography: (3, 3) from pixels of the video to world x, y [m]; all NaN where unknown.
        quality: how well the source could be read, by name: numbers, texts or lists.
        song_id: number that all demonstrations of one song share, so that they can be kept on one
            side of a train-validation split; -1 where unknown.
        split: part of the data set that it belongs to; only "train" is used for training.

    Raises:
        ValueError: the plan has not one row per frame or not one entry per note of the score.
    """

    score: Score
    plan: FingertipPlan
    source: str = ""
    homography: NDArray[np.float64] = field(default_factory=lambda: np.full((3, 3), np.nan))
    quality: dict[str, Any] = field(default_factory=dict)
    song_id: int = -1
    split: str = TRAIN

    def __post_init__(self) -> None:
        if len(self.plan) != self.score.frames():
            raise ValueError(
                f"the plan has {len(self.plan)} rows, the score {self.score.frames()} frames"
            )
        if len(self.plan.note_hand) != len(self.score):
            raise ValueError(
                f"the plan is for {len(self.plan.note_hand)} notes, the score has {len(self.score)}"
            )

    def __repr__(self) -> str:
        return short_repr(
            self,
            repr(self.score.title),
            f"{len(self.plan) / FRAME_RATE:.1f} s",
            count(len(self.score), "note"),
            f"source {self.source!r}",
        )

    def excerpt(self, start: float = 0.0, seconds: float = EXCERPT_SECONDS) -> Demonstration:
        """Cut out a part, between frames, that begins with the first sound at or after `start`.

        Args:
            start: where to look for the first sound [s].
            seconds: greatest length [s]; may be infinite.

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
        # The roll of a score that ends exactly on a frame has one more, silent row.
        finger_key[first + np.arange(len(rows)) >= end] = NO_KEY
        plan = FingertipPlan(
            self.plan.fingertips[rows],
            finger_key,
            self.plan.note_hand[inside][order],
            self.plan.note_finger[inside][order],
        )
        return replace(self, score=part, plan=plan)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write one .npz file, completely or not at all.

        Args:
            path: the file; its folder must exist.
        """
        arrays: dict[str, NDArray[Any]] = {
            _MARK: np.array(_VERSION),
            "source": np.array(self.source),
            "homography": self.homography,
            "quality": np.array(json.dumps(self.quality)),
            "song_id": np.array(self.song_id),
            "split": np.array(self.split),
        }
        arrays |= score_arrays(self.score) | plan_arrays(self.plan)
        with atomic(path) as temporary:
            write_arrays(temporary, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Demonstration:
        """Read a file that `save` wrote.

        Args:
            path: the file.

        Raises:
            OSError: the file does not exist or cannot be read.
            InputError: it is not a demonstration, of an unknown version, or damaged.
        """
        version = _MARK, _VERSION
        return read_archive(path, "a demonstration", version, _SCHEMA, cls._from_arrays)

    @classmethod
    def _from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> Demonstration:
        quality = parse_json(str(arrays["quality"]))
        check_json(quality, Field("object"), "quality")
        return cls(
            score_of(arrays),
            plan_of(arrays),
            str(arrays["source"]),
            arrays["homography"],
            quality,
            int(arrays["song_id"]),
            str(arrays["split"]),
        )


@dataclass(frozen=True)
class DemonstrationConfig:
    """How the plan of a demonstration is played."""

    feasible: bool = True
    """Move fingertips to where the robot's hands can be, see `make_feasible`; otherwise they are as
    they were recorded."""


@dataclass(frozen=True)
class DemonstrationPlanner:
    """The planner of one score: it returns the plan of a demonstration.

    Attributes:
        demonstration: whose plan to return.
        config: whether it is moved; by default it is as it was recorded, as learners need it.
    """

    demonstration: Demonstration
    config: DemonstrationConfig = DemonstrationConfig(feasible=False)

    def plan(self, score: Score) -> FingertipPlan:
        """Return the demonstration's plan, with the same fingers on the same keys.

        Args:
            score: must have the same roll as the demonstration's score, or as its beginning.

        Raises:
            InputError: it is another score.
        """
        shown = self.demonstration
        if score.frames() < shown.score.frames() and score.duration > 0:
            shown = shown.excerpt(0.0, score.duration)
        same = np.array_equal(score.roll(), shown.score.roll()) and len(score) == len(shown.score)
        if score is not shown.score and not same:
            raise InputError(
                f"{score.title}, {score.duration:.1f} s: is not the score of the demonstration "
                f"{shown.score.title}, {self.demonstration.score.duration:.1f} s"
            )
        return make_feasible(shown.plan) if self.config.feasible else shown.plan


def is_demonstration(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a demonstration, of any version, rather than other arrays."""
    return holds(path, _MARK)


def on_grid(score: Score) -> Score:
    """Move times that lie within rounding errors of a frame exactly onto the frame.

    Otherwise the rounding of a sum decides in which frame a note begins.

    Args:
        score: its onsets, offsets and pedal are moved by less than a microsecond.
    """

    def round_to_frame(times: NDArray[np.float64]) -> NDArray[np.float64]:
        frame = np.rint(times * FRAME_RATE)
        return np.where(np.abs(times * FRAME_RATE - frame) < 1e-5, frame / FRAME_RATE, times)

    return replace(
        score,
        onset=round_to_frame(score.onset),
        offset=round_to_frame(score.offset),
        pedal=round_to_frame(score.pedal),
    )

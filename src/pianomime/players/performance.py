"""Performance: what happened when a player played a score.

Everything shown or measured is made from it, so a saved performance can be scored, heard and
rendered again without simulating.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.archive import holds, read_archive, write_arrays
from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.music import Score, frame_metrics, notes_from_roll, onset_f1, pedal_f1
from pianomime.plan import FingertipPlan
from pianomime.plan.plan_arrays import (
    PLAN_SCHEMA,
    SCORE_SCHEMA,
    plan_arrays,
    plan_of,
    score_arrays,
    score_of,
)
from pianomime.schema import Field
from pianomime.short_repr import count, short_repr
from pianomime.world.layout import LAYOUT

_VELOCITY = 64
"""Of notes that nobody asked for."""

_VERSION = 3
"""Of the file; version 2 had no digest."""
_FRAMES = {
    "ctrl": Field("float", ("T", LAYOUT.ctrl_size)),
    "qpos": Field("float", ("T", LAYOUT.qpos_size)),
    "key_state": Field("float", ("T", KEYS), 0, 1),
    "pressed": Field("bool", ("T", KEYS)),
    "pedal": Field("bool", ("T",)),
    "blow_ups": Field("int", ("B",), 0),
}
_MARK = "key_state"
"""An array that other files do not hold."""
_SECONDS = {name: Field("float", (), 0) for name in ("plan_seconds", "simulate_seconds")}
_PLAYER = {"player": Field("text"), "effort": Field("int", (), 0)}
_SCHEMA = {
    **_PLAYER,
    **SCORE_SCHEMA,
    **_FRAMES,
    **_SECONDS,
    **{name: replace(field, optional=True) for name, field in PLAN_SCHEMA.items()},
}


@dataclass(frozen=True, eq=False)
class Performance:
    """A played song, one row for each 0.05 s frame.

    Attributes:
        score: what was to be played.
        player: name of the player.
        effort: how hard the player tried, 0 to 3.
        plan: the fingertip plan, None for players that have none.
        ctrl: (T, 46) controls, RIGHT 23 then LEFT 23 [rad, m].
        qpos: (T, 142) all joint positions after each frame: 88 keys, RIGHT 27, LEFT 27 [rad, m].
        key_state: (T, 88) 0..1 of the way down, after each frame.
        pressed: (T, 88) bool, after each frame; to be compared with `score.roll()`.
        pedal: (T,) bool.
        blow_ups: frames in which the physics broke and the world had to be put back.
        plan_seconds, simulate_seconds: how long planning, and tracking with simulating, took.
    """

    score: Score
    player: str
    effort: int
    plan: FingertipPlan | None
    ctrl: NDArray[np.float64]
    qpos: NDArray[np.float64]
    key_state: NDArray[np.float64]
    pressed: NDArray[np.bool_]
    pedal: NDArray[np.bool_]
    blow_ups: NDArray[np.int64]
    plan_seconds: float
    simulate_seconds: float

    def __post_init__(self) -> None:
        """Refuse arrays that do not fit together.

        Raises:
            ValueError: an array has another shape than it should.
        """
        frames = self.score.frames()
        for name, field in _FRAMES.items():
            shape, wanted = getattr(self, name).shape, (frames, *field.shape[1:])
            if name != "blow_ups" and shape != wanted:
                raise ValueError(f"{name} has shape {shape}, not {wanted}")
        if not ((self.blow_ups >= 0) & (self.blow_ups < frames)).all():
            raise ValueError(f"blow_ups must be frames 0..{frames - 1}")
        if self.plan is not None:
            planned = len(self.plan.fingertips), len(self.plan.note_hand)
            if planned != (frames, len(self.score)):
                raise ValueError(
                    f"a plan of {planned[0]} frames and {planned[1]} notes "
                    f"for a score of {frames} and {len(self.score)}"
                )

    def __repr__(self) -> str:
        return short_repr(
            self,
            repr(self.score.title),
            f"player {self.player!r}",
            f"{self.song_seconds:.1f} s",
            count(len(self.score), "note"),
            f"F1 {frame_metrics(self.score.roll(), self.pressed).f1:.3f}",
        )

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.pressed)

    @property
    def song_seconds(self) -> float:
        """Length of the played song [s]."""
        return len(self) / FRAME_RATE

    @property
    def realtime_factor(self) -> float:
        """Seconds of music played in a second of planning and simulating."""
        return self.song_seconds / (self.plan_seconds + self.simulate_seconds)

    @property
    def dropped_notes(self) -> int:
        """Number of notes that the planner left out."""
        return 0 if self.plan is None else self.plan.dropped

    def played(self) -> Score:
        """What was played, as a Score: notes from the pressed keys, pedal from the score.

        The simulated piano does not sense how hard a key is struck, so a note that was wanted
        has the velocity that the score asks for.
        """
        key, onset, offset = notes_from_roll(self.pressed)
        asked = np.zeros(self.pressed.shape, np.uint8)
        for note, (first, stop) in enumerate(self.score.note_frames()):
            asked[first:stop, self.score.key[note]] = self.score.velocity[note]
        velocity = np.full(len(key), _VELOCITY)
        for note, (first, stop) in enumerate(_frames(onset, offset)):
            heard = asked[first:stop, key[note]]
            if heard.any():
                velocity[note] = heard[heard > 0][0]
        edges = np.flatnonzero(np.diff(np.pad(self.pedal, 1).astype(np.int8)))
        pedal = edges.reshape(-1, 2) / FRAME_RATE
        return Score(key, onset, offset, velocity, pedal, self.score.title)

    def metrics(self) -> dict[str, float]:
        """How well it was played, each 0..1.

        Returns:
            `precision`, `recall` and `f1`, frame by frame; `onset_f1`, note onsets within 50 ms;
            `pedal_f1`.
        """
        wanted = self.score.roll()
        frames = frame_metrics(wanted, self.pressed)
        return {
            "precision": frames.precision,
            "recall": frames.recall,
            "f1": frames.f1,
            "onset_f1": onset_f1(
                (self.score.key, self.score.onset), notes_from_roll(self.pressed)[:2]
            ),
            "pedal_f1": pedal_f1(self.score.pedal_roll(), self.pedal),
        }

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to one .npz file, whole or not at all.

        Args:
            path: where to; its folder must exist.
        """
        arrays: dict[str, NDArray[Any]] = {"version": np.array(_VERSION)}
        for name in (*_PLAYER, *_FRAMES, *_SECONDS):
            arrays[name] = np.asarray(getattr(self, name))
        arrays |= score_arrays(self.score)
        if self.plan is not None:
            arrays |= plan_arrays(self.plan)
        with atomic(path) as temporary:
            write_arrays(temporary, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Performance:
        """Read what `save` wrote.

        Args:
            path: the .npz file.

        Raises:
            OSError: there is no such file, or it cannot be read.
            InputError: it is no performance, one of a version that we do not know, or damaged.
        """
        version = "version", _VERSION
        return read_archive(path, "a performance", version, _SCHEMA, cls._from_arrays)

    @classmethod
    def _from_arrays(cls, arrays: dict[str, NDArray[Any]]) -> Performance:
        planned = [name in arrays for name in PLAN_SCHEMA]
        if any(planned) != all(planned):
            raise ValueError("a part of the plan is missing")
        return cls(
            score=score_of(arrays),
            player=str(arrays["player"]),
            effort=int(arrays["effort"]),
            plan=plan_of(arrays) if all(planned) else None,
            **{name: arrays[name] for name in _FRAMES},
            plan_seconds=float(arrays["plan_seconds"]),
            simulate_seconds=float(arrays["simulate_seconds"]),
        )


def is_performance(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a performance, of any version, rather than other arrays."""
    return holds(path, _MARK)


def _frames(onset: NDArray[np.float64], offset: NDArray[np.float64]) -> NDArray[np.int64]:
    """(N, 2) first frame and one past the last of notes that begin and end with a frame."""
    return np.rint(np.stack([onset, offset], axis=1) * FRAME_RATE).astype(np.int64)

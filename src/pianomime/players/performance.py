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
from pianomime.music import (
    MusicMetrics,
    Score,
    frame_metrics,
    music_metrics,
    notes_from_roll,
    onset_f1,
    pedal_f1,
)
from pianomime.music.score import MAX_SECONDS
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
from pianomime.world.parameters import SUBSTEPS
from pianomime.world.touch import LOUDEST, SOFTEST, TOUCHES
from pianomime.world_names import PAPER, WORLDS

_VERSION = 4
"""Of the file; version 3 had one control a frame, and neither events nor times of the pedal."""
_FRAMES = {
    "ctrl": Field("float", ("T", "S", LAYOUT.ctrl_size)),
    "qpos": Field("float", ("T", LAYOUT.qpos_size)),
    "key_state": Field("float", ("T", KEYS), 0, 1),
    "pressed": Field("bool", ("T", KEYS)),
    "pedal": Field("bool", ("T",)),
    "blow_ups": Field("int", ("B",), 0),
}
_EVENTS = {
    "event_key": Field("int", ("E",), 0, KEYS - 1),
    "event_on": Field("float", ("E",), 0, MAX_SECONDS),
    "event_off": Field("float", ("E",), 0, MAX_SECONDS),
    "event_speed": Field("float", ("E",)),
    "pedal_times": Field("float", ("Q", 2), 0, MAX_SECONDS),
}
_MARK = "key_state"
"""An array that other files do not hold."""
_SECONDS = {name: Field("float", (), 0) for name in ("plan_seconds", "simulate_seconds")}
_PLAYER = {
    "player": Field("text"),
    "effort": Field("int", (), 0),
    "touch": Field("text", choices=tuple(TOUCHES)),
    "works_pedal": Field("bool", ()),
    # Files from before there was more than one have none.
    "world": Field("text", choices=WORLDS, optional=True),
}
_SCHEMA = {
    **_PLAYER,
    **SCORE_SCHEMA,
    **_FRAMES,
    **_EVENTS,
    "event_velocity": Field("int", ("E",), SOFTEST, LOUDEST),
    **_SECONDS,
    **{name: replace(field, optional=True) for name, field in PLAN_SCHEMA.items()},
}


@dataclass(frozen=True, eq=False)
class Performance:
    """A played song: T frames of 0.05 s, and E notes that sounded, at their own times.

    Attributes:
        score: what was to be played.
        player: name of the player.
        effort: how hard the player tried, 0 to 3.
        plan: the fingertip plan, None for players that have none.
        touch: name of the map from the speed of a key to MIDI velocity.
        works_pedal: whether the player works the pedal; otherwise the score does.
        world: name of the world in which it was played.
        ctrl: (T, S, 46) controls, S in each frame, RIGHT 23 then LEFT 23 [rad, m].
        qpos: (T, 142) all joint positions after each frame: 88 keys, RIGHT 27, LEFT 27 [rad, m].
        key_state: (T, 88) 0..1 of the way down, after each frame.
        pressed: (T, 88) bool, after each frame; to be compared with `score.roll()`.
        pedal: (T,) bool.
        event_key: (E,) key of each note that sounded, in the order of `event_on`.
        event_on, event_off: (E,) when its key began to sound and fell silent [s from the first
            frame]; a key that is down at the end is silent then.
        event_speed: (E,) speed of the key's front edge where it began to sound [m/s].
        pedal_times: (Q, 2) when the pedal was down, as in a `Score` [s].
        blow_ups: frames in which the physics broke and the world had to be put back.
        plan_seconds, simulate_seconds: how long planning, and tracking with simulating, took.
    """

    score: Score
    player: str
    effort: int
    touch: str
    works_pedal: bool
    world: str
    plan: FingertipPlan | None
    ctrl: NDArray[np.float64]
    qpos: NDArray[np.float64]
    key_state: NDArray[np.float64]
    pressed: NDArray[np.bool_]
    pedal: NDArray[np.bool_]
    event_key: NDArray[np.int64]
    event_on: NDArray[np.float64]
    event_off: NDArray[np.float64]
    event_speed: NDArray[np.float64]
    pedal_times: NDArray[np.float64]
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
            if name == "ctrl":
                wanted = (frames, shape[1] if len(shape) == 3 else 1, LAYOUT.ctrl_size)
            if name != "blow_ups" and shape != wanted:
                raise ValueError(f"{name} has shape {shape}, not {wanted}")
        if not self.ctrl.shape[1] or SUBSTEPS % self.ctrl.shape[1]:
            raise ValueError(
                f"a frame of {SUBSTEPS} physics steps cannot have {self.ctrl.shape[1]} controls"
            )
        if self.touch not in TOUCHES:
            raise ValueError(f"there is no touch {self.touch!r}; there are {', '.join(TOUCHES)}")
        if self.world not in WORLDS:
            raise ValueError(f"there is no world {self.world!r}; there are {', '.join(WORLDS)}")
        if not (self.event_on < self.event_off).all():
            raise ValueError("an event ends before it begins")
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

    @property
    def event_velocity(self) -> NDArray[np.int64]:
        """(E,) MIDI velocity of each note, 1 to 127, from the speed of its key."""
        return TOUCHES[self.touch].velocity_of(self.event_speed, self.event_key)

    def played(self) -> Score:
        """What was played, as a Score: what the keys sensed, and the pedal."""
        return Score(
            key=self.event_key,
            onset=self.event_on,
            offset=self.event_off,
            velocity=self.event_velocity,
            pedal=self.pedal_times,
            title=self.score.title,
        )

    def music(self) -> MusicMetrics:
        """How well it was played by the music protocol.

        Lifts of the pedal are not measured where the player does not work it: they are the score's.
        """
        metrics = music_metrics(self.score, self.played())
        return metrics if self.works_pedal else replace(metrics, pedal_lifts_kept=None)

    def metrics(self) -> dict[str, float]:
        """How well it was played, each 0..1.

        Returns:
            `precision`, `recall` and `f1`, frame by frame; `onset_f1`, note onsets within 50 ms, at
            20 Hz; `pedal_f1`, where the player works the pedal.
        """
        wanted = self.score.roll()
        frames = frame_metrics(wanted, self.pressed)
        metrics = {
            "precision": frames.precision,
            "recall": frames.recall,
            "f1": frames.f1,
            "onset_f1": onset_f1(
                (self.score.key, self.score.onset), notes_from_roll(self.pressed)[:2]
            ),
        }
        if self.works_pedal:
            metrics["pedal_f1"] = pedal_f1(self.score.pedal_roll(), self.pedal)
        return metrics

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write everything to one .npz file, whole or not at all.

        Args:
            path: where to; its folder must exist.
        """
        arrays: dict[str, NDArray[Any]] = {"version": np.array(_VERSION)}
        for name in (*_PLAYER, *_FRAMES, *_EVENTS, "event_velocity", *_SECONDS):
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
            touch=str(arrays["touch"]),
            works_pedal=bool(arrays["works_pedal"]),
            world=str(arrays.get("world", PAPER)),
            plan=plan_of(arrays) if all(planned) else None,
            **{name: arrays[name] for name in (*_FRAMES, *_EVENTS)},
            plan_seconds=float(arrays["plan_seconds"]),
            simulate_seconds=float(arrays["simulate_seconds"]),
        )


def is_performance(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a performance, of any version, rather than other arrays."""
    return holds(path, _MARK)

"""Episode: how a song was played, frame by frame, as policies learn from it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS, KEYS
from pianomime.music import Score, frame_metrics
from pianomime.players.rollout import Step, rollout, rollout_together
from pianomime.short_repr import short_repr
from pianomime.track import BatchController, Controller
from pianomime.world import World
from pianomime.world.batch_base import OneOfBatch, WorldBatchBase
from pianomime.world.key_sensor import NOTHING, KeyEvents
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT
from pianomime.world.touch import DEFAULT_TOUCH, TOUCHES
from pianomime.world_names import PAPER

if TYPE_CHECKING:
    from pianomime.learn.expert.expert_run import ExpertRun

_ID_BYTES = 6
"""Bytes of a song's number: all programs hold whole numbers of 48 bits exactly."""
_MILLISECONDS = 1000
"""In a second."""


@dataclass(frozen=True, eq=False)
class Episode:
    """One row a frame: the state before it, the action taken, and what the action was to reach.

    Attributes:
        name: of the song.
        f1: frame-wise F1 of the whole episode.
        base: the base controller of `base_control`, "ik" or "dynamic".
        columns: arrays (T, ...) by the names in `COLUMNS`.
        song_id: number that episodes of one song share; -1 if unknown.
        split: part of the data set that it belongs to; only "train" is for training.
        world: name of the world in which it was played.
        events: arrays (E,) by the names in `EVENTS`; of length 0 where keys were not sensed.
        source: where it came from, if it is known.
    """

    name: str
    f1: float
    base: str
    columns: dict[str, NDArray[Any]]
    song_id: int = -1
    split: str = "train"
    world: str = PAPER
    events: dict[str, NDArray[Any]] = field(default_factory=lambda: event_columns(NOTHING))
    source: Source | None = None

    __repr__ = short_repr


@dataclass(frozen=True)
class Source:
    """Where an episode came from.

    Attributes:
        title: of the file of music.
        digest: SHA-256 of that file, in hexadecimal digits.
        player: name of who played it.
        effort: how hard the player tried, 0 to 3.
        seed: of everything that was random.
        program: version of the program.
    """

    title: str
    digest: str
    player: str
    effort: int
    seed: int
    program: str


@dataclass(frozen=True)
class Column:
    """One array of an episode.

    Attributes:
        shape: of a row.
        dtype: of the numbers.
        description: what they are, with units.
    """

    shape: tuple[int, ...]
    dtype: str
    description: str


_BLOCK = 1000
"""Frames whose base controls are computed at once: their Jacobians take some 30 MB."""
_HANDS = "hands in the order right, left; forearm tx, ty, tz, WRJ2, WRJ1, FFJ4..1, MFJ4..1, "
_HANDS += "RFJ4..1, LFJ5..1, THJ5..1"
_CTRL = "right 23 then left 23 actuators: WRJ2, WRJ1, THJ5..1, FFJ4, FFJ3, FFJ0, MF and RF alike, "
_CTRL += "LFJ5, LFJ4, LFJ3, LFJ0, forearm tx, ty, tz"
_POINTS = "hands in the order left, right; wrist, thumb, index, middle, ring, little; world x y z"
_JOINTS_SHAPE, _CTRL_SHAPE = (LAYOUT.hands_size,), (LAYOUT.ctrl_size,)

COLUMNS = {
    "joints": Column(
        _JOINTS_SHAPE, "float32", f"joint positions before the action [rad, m]; {_HANDS}"
    ),
    "velocities": Column(_JOINTS_SHAPE, "float32", f"joint velocities [rad/s, m/s]; {_HANDS}"),
    "keys": Column((KEYS,), "float32", "how far each key is down before the action, 0..1"),
    "goal": Column((KEYS,), "bool", "keys that should sound after the action"),
    "pressed": Column((KEYS,), "bool", "keys that sound after the action"),
    "fingertips": Column((2, POINT_COUNT, 3), "float32", f"targets of the plan [m]; {_POINTS}"),
    "finger_key": Column((2, FINGER_COUNT), "int8", "key that each finger is to press, -1: none"),
    "base_control": Column(
        _CTRL_SHAPE, "float32", f"control of the base controller [rad, m]; {_CTRL}"
    ),
    "residual": Column(_CTRL_SHAPE, "float32", "action - base_control [rad, m]"),
    "action": Column(
        _CTRL_SHAPE,
        "float32",
        f"control that the expert sends in this state, or by DAgger would send [rad, m]; {_CTRL}",
    ),
}
"""All columns by name."""

EVENTS = {
    "event_time": Column((), "float64", "when a key began to sound or fell silent [s of episode]"),
    "event_key": Column((), "int8", "key of the event, 0..87"),
    "event_on": Column((), "bool", "whether the key began to sound; otherwise it fell silent"),
    "event_velocity": Column(
        (), "uint8", "MIDI velocity 1..127 of a key that began to sound, or 0"
    ),
}
"""What keys sensed between frames, by name: one row an event, in the order of time."""


class PhysicsError(InputError):
    """The physics broke in an episode, after which states do not follow from actions."""


class Recording(NamedTuple):
    """What `record` saw, or of one song `record_together`.

    Attributes:
        columns: of T frames; those that `fill_columns` fills are not filled yet.
        qpos: (T, 142) positions before each frame, as in `World.qpos` [rad, m].
        events: arrays by the names in `EVENTS`.
    """

    columns: dict[str, NDArray[Any]]
    qpos: NDArray[np.float64]
    events: dict[str, NDArray[Any]]


def play_episode(run: ExpertRun) -> Episode:
    """Have the best expert of a run play its song.

    Raises:
        InputError: nothing was trained in the run.
        PhysicsError: the physics broke while it was played.
    """
    # Late: other episodes need nothing of experts.
    from pianomime.learn.envs.batch import base_controller
    from pianomime.learn.expert.expert import expert_tracker

    demonstration, env = run.demonstration, run.config.env
    controller, base = (
        expert_tracker(run).start(demonstration.plan),
        base_controller(env, demonstration.plan),
    )
    columns, qpos, events = record(controller, demonstration.score, env.world)
    f1 = fill_columns(
        columns,
        base_controls(base, qpos),
        demonstration.score.roll(),
        demonstration.plan.fingertips,
        demonstration.plan.finger_key,
    )
    return Episode(
        demonstration.score.title,
        f1,
        env.base,
        columns,
        demonstration.song_id,
        demonstration.split,
        env.world,
        events,
    )


def record(
    controller: Controller, score: Score, world_name: str = PAPER, touch: str = DEFAULT_TOUCH
) -> Recording:
    """Play a score, and record states, controls and what keys sense.

    Args:
        controller: plays.
        score: what is played.
        world_name: name of the world in which it is played.
        touch: name of the map from the speed of a key to MIDI velocity.

    Raises:
        InputError: the controller gives several controls a frame, which is no action of a frame.
        PhysicsError: the physics broke while it was played.
    """
    pedal, world = score.pedal_roll(), World(world_name, quiet=True)
    recorder = _Recorder(len(pedal), world)
    for step in rollout(controller, world, pedal):
        controls = len(np.atleast_2d(step.ctrl))
        if controls > 1:
            raise InputError(
                f"a data set has one control a frame, not {controls}: collect from a player of "
                "frames, such as zero-shot-20hz"
            )
        recorder.record(step)
    return recorder.recording(touch)


def record_together(
    controllers: Sequence[Controller], scores: Sequence[Score], worlds: WorldBatchBase
) -> list[Recording | InputError]:
    """Play songs side by side, each in a world of its own, and record what `record` does.

    Args:
        controllers: play; they give one control a frame, and read of their world what a
            `WorldState` has.
        scores: what is played, one for each controller.
        worlds: as many, at rest.

    Returns:
        Of each song the recording, or why there is none: its controller raised an `InputError`, or
        the physics broke.
    """
    pedals = [score.pedal_roll() for score in scores]
    recorders = [
        _Recorder(len(pedal), OneOfBatch(worlds, index)) for index, pedal in enumerate(pedals)
    ]
    ended: dict[int, Recording | InputError] = {}
    for steps in rollout_together(controllers, worlds, pedals):
        for index, step in steps.items():
            if isinstance(step, InputError):
                ended[index] = step
                continue
            recorders[index].record(step)
            if step.frame + 1 == len(pedals[index]):
                ended[index] = _recording_of(recorders[index])
    return [ended[index] for index in range(len(pedals))]


def _recording_of(recorder: _Recorder) -> Recording | PhysicsError:
    try:
        return recorder.recording(DEFAULT_TOUCH)
    except PhysicsError as error:
        return error


class _Recorder:
    """Records one song frame by frame, from the state before the first.

    Args:
        frames: of the song.
        world: where it is played.
    """

    def __init__(self, frames: int, world: World | OneOfBatch) -> None:
        self._world, self._frames = world, frames
        self._columns, self._events = empty_columns(frames), NOTHING
        self._qpos = np.empty((frames, LAYOUT.qpos_size))
        self._observe(0)

    def record(self, step: Step) -> None:
        """Record a frame, after which the world is as it is now."""
        self._columns["action"][step.frame] = step.ctrl
        self._columns["pressed"][step.frame] = self._world.pressed
        events = step.key_events.later(step.frame * FRAME_SECONDS)
        self._events = self._events.followed_by(events)
        if step.frame + 1 < self._frames:
            self._observe(step.frame + 1)

    def recording(self, touch: str) -> Recording:
        """All of it.

        Raises:
            PhysicsError: the physics broke.
        """
        broken = self._world.blow_ups
        if broken:
            raise PhysicsError(f"the physics broke in {broken} of {self._frames} frames")
        return Recording(self._columns, self._qpos, event_columns(self._events, touch))

    def _observe(self, frame: int) -> None:
        self._qpos[frame] = self._world.qpos
        self._columns["joints"][frame] = self._world.qpos_hands
        self._columns["velocities"][frame] = self._world.qvel_hands
        self._columns["keys"][frame] = self._world.key_state


def base_controls(base: BatchController, qpos: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, 46) What a base controller would send in each state of an episode [rad, m].

    Many at once, which is faster than frame by frame, and gives the same bit for bit.

    Args:
        base: the base controller.
        qpos: (T, 142) positions before each frame, as in `World.qpos` [rad, m].
    """
    blocks = range(0, len(qpos), _BLOCK)
    frames = np.arange(len(qpos))
    return np.concatenate(
        [base.controls(frames[at : at + _BLOCK], qpos[at : at + _BLOCK])[0] for at in blocks]
    )


def event_columns(events: KeyEvents, touch: str = DEFAULT_TOUCH) -> dict[str, NDArray[Any]]:
    """Arrays by the names in `EVENTS`.

    Args:
        events: of a World, timed from the beginning of the episode.
        touch: name of the map from the speed of a key to MIDI velocity.
    """
    # Those of one physics step stand in the order of keys.
    order = np.argsort(events.time, kind="stable")
    key, on, speed = events.key[order], events.on[order], events.speed[order]
    arrays = {
        "event_time": events.time[order],
        "event_key": key,
        "event_on": on,
        "event_velocity": np.where(on, TOUCHES[touch].velocity_of(speed, key), 0),
    }
    return {name: arrays[name].astype(column.dtype) for name, column in EVENTS.items()}


def empty_columns(frames: int) -> dict[str, NDArray[Any]]:
    """All columns of an episode of so many frames, to be filled."""
    return {
        name: np.empty((frames, *column.shape), column.dtype) for name, column in COLUMNS.items()
    }


def fill_columns(
    columns: dict[str, NDArray[Any]],
    base_control: NDArray[np.float64],
    goal: NDArray[np.bool_],
    fingertips: NDArray[np.float64],
    finger_key: NDArray[np.int8],
) -> float:
    """Fill in the columns of the plan and of the base controller, where all others are filled.

    Args:
        columns: of T frames, filled in place.
        base_control: (T, 46) controls of the base controller [rad, m].
        goal: (T, 88) keys that should sound.
        fingertips: (T, 2, 6, 3) targets [m].
        finger_key: (T, 2, 5) the key that each finger is to press, -1 for none.

    Returns:
        The frame-wise F1 of the keys that sounded.
    """
    columns["base_control"][:] = base_control
    columns["goal"][:] = goal
    columns["fingertips"][:] = fingertips
    columns["finger_key"][:] = finger_key
    columns["residual"][:] = columns["action"] - columns["base_control"]
    return frame_metrics(goal, columns["pressed"]).f1


def song_number(score: Score) -> int:
    """A number that is the same for files of the same music: of its keys in their order.

    Tempo, loudness, pedal and title make no difference.

    Args:
        score: of the whole piece.
    """
    # Keys that go down together are in one order, whichever the file has them in.
    order = np.lexsort((score.key, np.rint(score.onset * _MILLISECONDS)))
    digest = hashlib.sha256(score.key[order].astype(np.uint8).tobytes()).digest()
    return int.from_bytes(digest[:_ID_BYTES], "big")

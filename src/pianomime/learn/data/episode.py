"""Episode: how a song was played, frame by frame, as policies learn from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import KEYS
from pianomime.music import Score, frame_metrics
from pianomime.players.rollout import rollout
from pianomime.short_repr import short_repr
from pianomime.track import Controller
from pianomime.world import World
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT
from pianomime.world_names import PAPER

if TYPE_CHECKING:
    from pianomime.learn.expert.expert_run import ExpertRun


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
    """

    name: str
    f1: float
    base: str
    columns: dict[str, NDArray[Any]]
    song_id: int = -1
    split: str = "train"
    world: str = PAPER

    __repr__ = short_repr


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


def play_episode(run: ExpertRun) -> Episode:
    """Have the best expert of a run play its song.

    Raises:
        InputError: nothing was trained in the run.
    """
    # Late: other episodes need nothing of experts.
    from pianomime.learn.envs.batch import base_controller
    from pianomime.learn.expert.expert import expert_tracker

    demonstration, env = run.demonstration, run.config.env
    controller, base = (
        expert_tracker(run).start(demonstration.plan),
        base_controller(env, demonstration.plan),
    )
    columns = record(controller, base, demonstration.score, env.world)
    f1 = fill_columns(
        columns,
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
    )


def record(
    controller: Controller, base: Controller, score: Score, world_name: str = PAPER
) -> dict[str, NDArray[Any]]:
    """Play a score, and record states and controls.

    Args:
        controller: plays.
        base: the base controller, asked for its control in every state.
        score: what is played.
        world_name: name of the world in which it is played.

    Returns:
        The columns; those that `fill_columns` fills are not filled yet.

    Raises:
        InputError: the controller gives several controls a frame, which is no action of a frame.
    """
    pedal, world = score.pedal_roll(), World(world_name, quiet=True)
    columns = empty_columns(len(pedal))

    def observe(frame: int) -> None:
        columns["joints"][frame] = world.qpos_hands
        columns["velocities"][frame] = world.qvel_hands
        columns["keys"][frame] = world.key_state
        columns["base_control"][frame] = base.control(frame, world)

    observe(0)
    for step in rollout(controller, world, pedal):
        controls = len(np.atleast_2d(step.ctrl))
        if controls > 1:
            raise InputError(
                f"a data set has one control a frame, not {controls}: collect from a player of "
                "frames, such as zero-shot-20hz"
            )
        columns["action"][step.frame] = step.ctrl
        columns["pressed"][step.frame] = world.pressed
        if step.frame + 1 < len(pedal):
            observe(step.frame + 1)
    return columns


def empty_columns(frames: int) -> dict[str, NDArray[Any]]:
    """All columns of an episode of so many frames, to be filled."""
    return {
        name: np.empty((frames, *column.shape), column.dtype) for name, column in COLUMNS.items()
    }


def fill_columns(
    columns: dict[str, NDArray[Any]],
    goal: NDArray[np.bool_],
    fingertips: NDArray[np.float64],
    finger_key: NDArray[np.int8],
) -> float:
    """Fill in the plan's columns and the residual, where all others are filled.

    Args:
        columns: of T frames, filled in place.
        goal: (T, 88) keys that should sound.
        fingertips: (T, 2, 6, 3) targets [m].
        finger_key: (T, 2, 5) the key that each finger is to press, -1 for none.

    Returns:
        The frame-wise F1 of the keys that sounded.
    """
    columns["goal"][:] = goal
    columns["fingertips"][:] = fingertips
    columns["finger_key"][:] = finger_key
    columns["residual"][:] = columns["action"] - columns["base_control"]
    return frame_metrics(goal, columns["pressed"]).f1

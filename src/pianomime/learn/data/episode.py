"""Episode: how an expert played a song, as others learn from it."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import KEYS, NO_KEY
from pianomime.learn.data.published import songs_and_splits
from pianomime.learn.envs.batch import prior_tracker
from pianomime.learn.expert.expert import expert_tracker
from pianomime.learn.runs.run import RunFolder
from pianomime.music import frame_metrics
from pianomime.plan import FingertipPlan
from pianomime.track import IkTracker, PedalTracker
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_travel
from pianomime.world.state import PRESSED_WITHIN


@dataclass(frozen=True, eq=False)
class Episode:
    """One row a frame; row t is the state before action t, and what action t was to reach.

    Attributes:
        name: of the song.
        f1: frame-wise, of the whole.
        prior_name: the tracker that proposed `prior`, "ik" or "dynamic".
        columns: arrays by the names in `COLUMNS`.
        song: number that episodes of one song share; -1 where nobody knows.
        split: part of the data set that it belongs to; only "train" is for training.
    """

    name: str
    f1: float
    prior_name: str
    columns: dict[str, NDArray[Any]]
    song: int = -1
    split: str = "train"


@dataclass(frozen=True)
class Column:
    """One array of an episode.

    Attributes:
        shape: of a row.
        dtype: of the numbers.
        about: what they are, with unit.
    """

    shape: tuple[int, ...]
    dtype: str
    about: str


_HANDS = "hands in the order right, left; forearm tx, ty, tz, WRJ2, WRJ1, FFJ4..1, MFJ4..1, "
_HANDS += "RFJ4..1, LFJ5..1, THJ5..1"
_CTRL = "right 23 then left 23 actuators: WRJ2, WRJ1, THJ5..1, FFJ4, FFJ3, FFJ0, MF and RF alike, "
_CTRL += "LFJ5, LFJ4, LFJ3, LFJ0, forearm tx, ty, tz"
_POINTS = "hands in the order left, right; forearm, thumb, index, middle, ring, little; world x y z"

COLUMNS = {
    "joints": Column((54,), "float32", f"joint positions before the action [rad, m]; {_HANDS}"),
    "velocities": Column((54,), "float32", f"joint velocities [rad/s, m/s]; {_HANDS}"),
    "keys": Column((KEYS,), "float32", "how far each key is down before the action, 0..1"),
    "goal": Column((KEYS,), "bool", "keys that should sound after the action"),
    "pressed": Column((KEYS,), "bool", "keys that sound after the action"),
    "fingertips": Column((2, 6, 3), "float32", f"the plan's targets [m]; {_POINTS}"),
    "finger_key": Column((2, 5), "int8", "key that each finger is to press, -1 for none"),
    "prior": Column((46,), "float32", f"control that the prior proposes [rad, m]; {_CTRL}"),
    "residual": Column((46,), "float32", "action - prior"),
    "action": Column((46,), "float32", f"control that was sent [rad, m]; {_CTRL}"),
}
"""All columns by name."""


def play_episode(run: RunFolder) -> Episode:
    """Have the best expert of a run play its song.

    Raises:
        InputError: nothing was trained in the run.
    """
    plan, goal, pedal = run.song.plan, run.song.score.roll(), run.song.score.pedal_roll()
    tracker, prior = expert_tracker(run), prior_tracker(run.config.env)
    world = World(quiet=True)
    tracker.begin(plan)
    prior.begin(plan)
    columns = empty_columns(len(plan))
    pedal_tracker = tracker if isinstance(tracker, PedalTracker) else None
    for frame in range(len(plan)):
        write_state(columns, frame, world)
        columns["prior"][frame] = prior.control(frame, world)
        ctrl = tracker.control(frame, world)
        columns["action"][frame] = ctrl
        if pedal_tracker is not None:
            pedal[frame] = pedal_tracker.pedal(frame)
        world.step(ctrl, bool(pedal[frame]))
        columns["pressed"][frame] = world.pressed
    f1 = fill_columns(columns, goal, plan.fingertips, plan.finger_key)
    song = run.song
    return Episode(song.score.title, f1, run.config.env.prior, columns, song.song, song.split)


def published_episodes(experts: Path, demonstrations: Path) -> Iterator[tuple[Episode, int]]:
    """Episodes of PianoMime's published experts, one after the other, and how many there are.

    Args:
        experts: .npz with clip_id, length, qpos_1e4, qvel_500, key_state_255 and ctrl_1e4.
        demonstrations: .npz with clip_id, length, fingertips, finger_key and goal_packed of the
            same clips, and more; where it has song_group, split and odd, they are kept.

    Raises:
        InputError: the files are not what they should be.
    """
    recorded = _arrays(experts, "clip_id length qpos_1e4 qvel_500 key_state_255 ctrl_1e4")
    human = _arrays(
        demonstrations, "clip_id length fingertips finger_key goal_packed", "song_group split odd"
    )
    for path, arrays, column in (
        (experts, recorded, "ctrl_1e4"),
        (demonstrations, human, "goal_packed"),
    ):
        fits = arrays["length"].shape == arrays["clip_id"].shape
        if not fits or arrays["length"].sum() != len(arrays[column]):
            raise InputError(f"{path}: the lengths of the clips do not add up")
    place = {clip: row for row, clip in enumerate(human["clip_id"].tolist())}
    human_ends = np.cumsum(human["length"])
    song, split = songs_and_splits(demonstrations, human, len(place))
    ends = np.cumsum(recorded["length"])
    for clip, end, length in zip(
        recorded["clip_id"].tolist(), ends, recorded["length"], strict=True
    ):
        if clip not in place:
            raise InputError(f"{demonstrations}: has no clip {clip}")
        if human["length"][place[clip]] != length:
            raise InputError(f"{demonstrations}: clip {clip} is not as long as in {experts}")
        rows = slice(end - length, end)
        theirs = slice(human_ends[place[clip]] - length, human_ends[place[clip]])
        columns = empty_columns(int(length))
        columns["joints"][:] = world_order(recorded["qpos_1e4"][rows] / 1e4)
        columns["velocities"][:] = world_order(recorded["qvel_500"][rows] / 500.0)
        keys = recorded["key_state_255"][rows] / 255.0
        columns["keys"][:] = keys
        columns["action"][:] = recorded["ctrl_1e4"][rows] / 1e4
        # The keys that the next row tells; of the last action nothing is known but what was before.
        sounds = (1.0 - keys) * key_travel() <= PRESSED_WITHIN
        columns["pressed"][:] = np.vstack([sounds[1:], sounds[-1:]])
        tips = human["fingertips"][theirs].astype(float)
        finger_key = human["finger_key"][theirs].astype(np.int8)
        columns["prior"][:] = _ik_prior(tips, columns["joints"], keys)
        goal = np.unpackbits(human["goal_packed"][theirs], axis=1)[:, :KEYS].astype(bool)
        f1 = fill_columns(columns, goal, tips, finger_key)
        name = f"clip{clip:03d}"
        row = place[clip]
        yield Episode(name, f1, "ik", columns, song[row], split[row]), len(ends)


def world_order(recorded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joints (T, 54) as published, left before right and forearm last, as a World has them."""
    left, right = recorded[:, : LAYOUT.hand_joints], recorded[:, LAYOUT.hand_joints :]
    return np.hstack([np.roll(hand, 3, axis=1) for hand in (right, left)])


def _ik_prior(
    tips: NDArray[np.float64], joints: NDArray[np.float64], keys: NDArray[np.float64]
) -> NDArray[np.float64]:
    tracker, world = IkTracker(), World(quiet=True)
    idle = np.full((len(tips), 2, 5), NO_KEY, np.int8)
    none = np.zeros(0, np.int8)
    tracker.begin(FingertipPlan(tips, idle, none, none))
    prior = np.empty((len(tips), 46))
    for frame in range(len(tips)):
        world.data.qpos[:] = np.r_[keys[frame] * key_travel(), joints[frame]]
        prior[frame] = tracker.control(frame, world)
    return prior


def empty_columns(frames: int) -> dict[str, NDArray[Any]]:
    """All columns of an episode of so many frames, to be written into."""
    return {
        name: np.empty((frames, *column.shape), column.dtype) for name, column in COLUMNS.items()
    }


def fill_columns(
    columns: dict[str, NDArray[Any]],
    goal: NDArray[np.bool_],
    tips: NDArray[np.float64],
    finger_key: NDArray[np.int8],
) -> float:
    """Write what the plan tells, and the residual, into columns that have all else; their F1."""
    columns["goal"][:] = goal
    columns["fingertips"][:] = tips
    columns["finger_key"][:] = finger_key
    columns["residual"][:] = columns["action"] - columns["prior"]
    return frame_metrics(goal, columns["pressed"]).f1


def write_state(columns: dict[str, NDArray[Any]], frame: int, world: World) -> None:
    """Write the world as it is before a frame."""
    columns["joints"][frame] = world.qpos_hands
    columns["velocities"][frame] = world.qvel_hands
    columns["keys"][frame] = world.key_state


def _arrays(path: Path, names: str, more: str = "") -> dict[str, NDArray[Any]]:
    """Arrays of a file by name, and those of `more` that it has."""
    try:
        with np.load(path, allow_pickle=False) as file:
            there = [name for name in more.split() if name in file]
            return {name: file[name] for name in [*names.split(), *there]}
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist") from None
    except KeyError as error:
        raise InputError(f"{path}: has no {error.args[0]}") from error
    except (ValueError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not an .npz file of arrays ({error})") from error

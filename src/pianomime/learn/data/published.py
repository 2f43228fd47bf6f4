"""Reader of the data that the PianoMime authors published, and of arrays in the same form.

Demonstrations: known faults are repaired. These are points that were never detected and are in the
robot's rest pose (z above 0.1 m), an older convention for z of pressing fingers, presses that were
left over when a hand was not detected, fingers that press keys which are not in the goal, and jumps
of single frames. An .npz file may have for each clip its `song_group`, its `split`, and whether it
is `odd`, which is that nothing can be learned from it; such a clip is in the split "odd".

Experts: recorded joints, keys and controls become episodes in our order of joints.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pianomime.archive import read_arrays
from pianomime.errors import InputError, reason_of
from pianomime.installation import install_command
from pianomime.keyboard import KEYS, NO_KEY
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.plan.demonstration import TRAIN, Demonstration, on_grid
from pianomime.plan.fingertip_plan import HOVER_HEIGHT
from pianomime.plan.plan_arrays import FINGER_KEY, FINGERTIPS
from pianomime.schema import MOST_BYTES, Field
from pianomime.shown import shown
from pianomime.track import IkTracker
from pianomime.video.hands.repair import at_rest, outliers
from pianomime.world.key_sensor import PRESSED_WITHIN
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT, POINTS_SIZE
from pianomime.world.parameters import key_centres, key_travel

if TYPE_CHECKING:
    from pianomime.learn.data.episode import Episode

_ON_KEY = 0.005
"""[m] Distance along the keyboard from the middle of a key within which a finger at z = 0 presses
it."""
_UNDETECTED_HEIGHT = 0.1
"""[m] z above which a point was not detected and is in the robot's rest pose."""
_JUMP = 0.10
"""[m] A point this far from its neighbours in time was detected wrongly."""
_MOST_FRAMES = 10_000_000
"""Frames of a data set, a hundred times those that were published."""
_WIDTHS = (212, 184)
"""Columns of the high-level data set's state and action."""
_ODD = "odd"
_MARKS = {
    "song_group": Field("int", ("C",), -1, optional=True),
    "split": Field("text", ("C",), optional=True),
    "odd": Field("bool", ("C",), optional=True),
}
"""What a file may say of each of its C clips."""
_TIPS = Field("number", FINGERTIPS.shape, FINGERTIPS.least, FINGERTIPS.most, may_be_nan=True)
_PACKED = Field("int", ("T", (KEYS + 7) // 8), 0, 255)
_LENGTH = Field("int", ("C",), 1, _MOST_FRAMES)
_CLIPS = {
    "fingertips": _TIPS,
    "goal": Field("number", ("T", KEYS), 0, 1, optional=True),
    "goal_packed": replace(_PACKED, optional=True),
    "length": replace(_LENGTH, optional=True),
    **_MARKS,
}
"""Concatenated clips, or one."""
_CLIP_ID = {"clip_id": Field("int", ("C",), 0), "length": _LENGTH}
_HUMAN = {
    **_CLIP_ID,
    "fingertips": replace(_TIPS, may_be_nan=False),
    "finger_key": FINGER_KEY,
    "goal_packed": _PACKED,
    **_MARKS,
}
_LARGEST = 2**15
"""Numbers of the published experts are of 16 bits."""
_RECORDED = {
    **_CLIP_ID,
    "qpos_1e4": Field("number", ("T", LAYOUT.hands_size), -_LARGEST, _LARGEST),
    "qvel_500": Field("number", ("T", LAYOUT.hands_size), -_LARGEST, _LARGEST),
    "key_state_255": Field("number", ("T", KEYS), 0, 255),
    "ctrl_1e4": Field("number", ("T", LAYOUT.ctrl_size), -_LARGEST, _LARGEST),
}
"""Experts' trajectories, and the demonstrations that they were trained on."""


def read_published(source: Path, limit: int | None = None) -> Iterator[tuple[Demonstration, int]]:
    """Demonstrations of a data set, each with the number of all.

    Args:
        source: a folder with a zarr data set, or an .npz file.
        limit: read only so many; None for all.

    Raises:
        OSError: there is no such file, or it cannot be read.
        InputError: the data are not of a known kind, or the limit is below 1.
    """
    if limit is not None and limit < 1:
        raise InputError(f"the number of clips must be 1 or more, not {limit}")
    clips = _zarr(source) if source.is_dir() else _npz(source)
    names = [f"{source.stem}-{number:03d}" for number in range(len(clips))]
    if len(clips) == 1:
        names = [source.stem]
    total = len(clips) if limit is None else min(limit, len(clips))
    for clip, name in zip(clips[:total], names, strict=False):
        made = demonstration_of(clip.fingertips, clip.goal, name, shown(source.name))
        yield replace(made, song_id=clip.song_id, split=clip.split), total


def published_episodes(experts: Path, demonstrations: Path) -> Iterator[tuple[Episode, int]]:
    """Episodes of PianoMime's published experts, each with the number of all.

    Args:
        experts: .npz with clip_id, length, qpos_1e4, qvel_500, key_state_255 and ctrl_1e4.
        demonstrations: .npz with clip_id, length, fingertips, finger_key and goal_packed of at
            least the same clips; song_group, split and odd are optional.

    Raises:
        InputError: the files are not what they should be.
    """
    # Late: `import-demos` works without the extra that episodes need.
    from pianomime.learn.data.episode import Episode, empty_columns, fill_columns

    recorded = _arrays(experts, _RECORDED)
    human = _arrays(demonstrations, _HUMAN)
    for path, arrays, column in (
        (experts, recorded, "ctrl_1e4"),
        (demonstrations, human, "goal_packed"),
    ):
        if arrays["length"].sum() != len(arrays[column]):
            raise InputError(f"{path}: the lengths of the clips do not add up")
    place = {clip: row for row, clip in enumerate(human["clip_id"].tolist())}
    human_ends = np.cumsum(human["length"])
    if len(place) != len(human["clip_id"]):
        raise InputError(f"{demonstrations}: a clip is there twice")
    song, split = _songs_and_splits(human, len(place))
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
        # The keys in the next row are those after the action; the last row has no next one.
        sounds = (1.0 - keys) * key_travel() <= PRESSED_WITHIN
        columns["pressed"][:] = np.vstack([sounds[1:], sounds[-1:]])
        tips = human["fingertips"][theirs].astype(float)
        finger_key = human["finger_key"][theirs].astype(np.int8)
        packed = human["goal_packed"][theirs].astype(np.uint8)
        goal = np.unpackbits(packed, axis=1)[:, :KEYS].astype(bool)
        base = _ik_controls(tips, columns["joints"])
        f1 = fill_columns(columns, base, goal, tips, finger_key)
        name = f"clip{clip:03d}"
        row = place[clip]
        yield Episode(name, f1, "ik", columns, song[row], split[row]), len(ends)


def world_order(recorded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joints (T, 54) in the order of a World, of published ones: left first, forearms last."""
    left, right = recorded[:, : LAYOUT.hand_joints], recorded[:, LAYOUT.hand_joints :]
    return np.hstack([np.roll(hand, LAYOUT.slides.stop, axis=1) for hand in (right, left)])


def _ik_controls(
    fingertips: NDArray[np.float64], joints: NDArray[np.floating]
) -> NDArray[np.float64]:
    """Controls of inverse kinematics (T, 46) for targets (T, 2, 6, 3) [m] at joints (T, 54)."""
    frames = len(fingertips)
    idle = np.full((frames, 2, FINGER_COUNT), NO_KEY, np.int8)
    no_notes = np.zeros(0, np.int8)
    controller = IkTracker().start(FingertipPlan(fingertips, idle, no_notes, no_notes))
    # The positions of the keys do not matter to it.
    qpos = np.hstack([np.zeros((frames, KEYS)), joints])
    return controller.controls(np.arange(frames), qpos)[0]


def _songs_and_splits(arrays: dict[str, NDArray[Any]], clips: int) -> tuple[list[int], list[str]]:
    """The song and the split of each clip, as far as a file of clips has them.

    Args:
        arrays: `song_group`, `split` and `odd` of each clip, where it has them.
        clips: number of clips.
    """
    song = arrays.get("song_group", np.full(clips, -1))
    split = arrays.get("split", np.full(clips, TRAIN))
    odd = arrays.get("odd", np.zeros(clips, bool))
    return song.tolist(), np.where(odd, _ODD, split).tolist()


def demonstration_of(
    fingertips: NDArray[np.float64], goal: NDArray[np.bool_] | None, title: str, source: str
) -> Demonstration:
    """A demonstration from arrays in the published form.

    Args:
        fingertips: (T, 2, 6, 3) world [m], hands (left, right).
        goal: (T, 88) keys that should be down; None to take them from the fingers.
        title: of the piece.
        source: name of the data set.
    """
    tips, mended = _mend(np.asarray(fingertips, np.float64))
    pressing = _pressed(tips)
    stale = 0
    if goal is None:
        down = np.zeros((len(tips), KEYS), bool)
        frame, hand, finger = np.nonzero(pressing >= 0)
        down[frame, pressing[frame, hand, finger]] = True
    else:
        down = np.asarray(goal, bool)
        asked = np.take_along_axis(down, np.maximum(pressing, 0).reshape(len(tips), -1), axis=1)
        wrong = (pressing >= 0) & ~asked.reshape(pressing.shape)
        stale = int(wrong.sum())
        pressing[wrong] = NO_KEY
    score = on_grid(Score.from_roll(down, title=title))
    frames = score.frames()
    rows = np.minimum(np.arange(frames), len(tips) - 1)
    finger_key = pressing[rows].astype(np.int8)
    finger_key[len(tips) :] = NO_KEY
    roll = score.roll()
    # Keys that are due but that no finger presses: the one that presses them before or after.
    note_hand = np.full(len(score), -1, np.int8)
    note_finger = note_hand.copy()
    for note, (first, end) in enumerate(score.note_frames()):
        often = (finger_key[first:end] == score.key[note]).sum(axis=0)
        if not often.any():
            continue
        hand, finger = np.unravel_index(often.argmax(), often.shape)
        note_hand[note], note_finger[note] = hand, finger
        mine = finger_key[first:end, hand, finger]
        mine[mine == NO_KEY] = score.key[note]
    finger_key[
        ~np.take_along_axis(
            roll, np.maximum(finger_key, 0).reshape(frames, -1).astype(np.int64), axis=1
        ).reshape(finger_key.shape)
    ] = NO_KEY
    points = tips[rows].copy()
    points[..., 2] = HOVER_HEIGHT
    frame, hand, finger = np.nonzero(finger_key >= 0)
    points[frame, hand, finger + 1, 1] = key_centres()[finger_key[frame, hand, finger], 1]
    points[frame, hand, finger + 1, 2] = 0.0
    return Demonstration(
        score,
        FingertipPlan(points, finger_key, note_hand, note_finger),
        source,
        quality={
            "notes": len(score),
            "notes_without_finger": int((note_hand < 0).sum()),
            "points_mended": int(mended),
            "stale_presses": stale,
        },
    )


def _mend(tips: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    """Interpolate points that were never or wrongly detected; the points, and how many there were.

    Raises:
        InputError: they have another shape.
    """
    if tips.ndim != 4 or tips.shape[1:] != (2, POINT_COUNT, 3) or not len(tips):
        raise InputError(f"fingertips must be (T, 2, 6, 3), not {tips.shape}")
    bad = tips[..., 2] > _UNDETECTED_HEIGHT
    for hand, point in np.ndindex(2, POINT_COUNT):
        bad[:, hand, point] |= outliers(tips[:, hand, point, :2], _JUMP)
    # A finger that presses is where its key is.
    bad &= tips[..., 2] != 0.0
    unknown: NDArray[np.bool_] = ~np.all(np.isfinite(tips), axis=3)
    bad |= unknown
    mended = tips.copy()
    time = np.arange(len(tips))
    for hand, point in np.ndindex(2, POINT_COUNT):
        wrong = bad[:, hand, point]
        if wrong.all():
            mended[unknown[:, hand, point], hand, point] = *at_rest(hand)[point], HOVER_HEIGHT
        elif wrong.any():
            for axis in range(2):
                mended[wrong, hand, point, axis] = np.interp(
                    time[wrong], time[~wrong], tips[~wrong, hand, point, axis]
                )
    return mended, int(bad.sum())


def _pressed(tips: NDArray[np.float64]) -> NDArray[np.int64]:
    """(T, 2, 5) the key under each finger whose z means that it presses, -1 for none."""
    height = tips[:, :, 1:, 2]
    low = height <= 0.001
    if not low.any():
        # Two of the clips have a pressing finger at the middle of its key's box.
        low = height < 0.03
    off = np.abs(tips[:, :, 1:, 1, None] - key_centres()[:, 1])
    nearest = off.argmin(axis=3)
    return np.where(low & (off.min(axis=3) < _ON_KEY), nearest, NO_KEY)


@dataclass(frozen=True, eq=False)
class _Clip:
    """Fingertips (T, 2, 6, 3) [m], goals (T, 88) if they are known, song and split."""

    fingertips: NDArray[np.float64]
    goal: NDArray[np.bool_] | None
    song_id: int = -1
    split: str = TRAIN


def _npz(path: Path) -> list[_Clip]:
    arrays = read_arrays(path, "an .npz file of clips", _CLIPS)
    tips = arrays["fingertips"]
    goal: NDArray[np.bool_] | None = arrays.get("goal")
    packed = arrays.get("goal_packed")
    if packed is not None:
        goal = np.unpackbits(packed.astype(np.uint8), axis=1)[:, :KEYS].astype(bool)
    # One clip says nothing of its length; its marks, if any, are those of one.
    length = arrays.get("length", np.array([len(tips)]))
    if any(len(arrays[name]) != len(length) for name in _MARKS if name in arrays):
        raise InputError(f"{path}: song_group, split and odd must have one entry a clip")
    if int(length.sum()) != len(tips):
        raise InputError(f"{path}: the lengths of the clips do not add up to {len(tips)} frames")
    song, split = _songs_and_splits(arrays, len(length))
    ends = np.cumsum(length)
    return [
        _Clip(
            tips[end - frames : end],
            None if goal is None else goal[end - frames : end],
            song[clip],
            split[clip],
        )
        for clip, (end, frames) in enumerate(zip(ends, length, strict=True))
    ]


def _zarr(folder: Path) -> list[_Clip]:
    """The high-level data set: state (N, 212) and action (N, 184), ends of clips inclusive."""
    try:
        zarr: Any = importlib.import_module("zarr")
    except ImportError as error:
        raise InputError(
            f"{folder}: reading it needs the package zarr: {install_command('video')}"
        ) from error
    refusal = f"{folder}: not PianoMime's high-level data set"
    try:
        root = zarr.open_group(str(folder), mode="r")
        group, meta = (root.get(name, root) for name in ("data", "meta"))
        state, action_array, end_array = group["state"], group["action"], meta["episode_ends"]
        for array, width in zip((state, action_array), _WIDTHS, strict=True):
            if array.ndim != 2 or array.shape[1] != width:
                raise InputError(f"its columns are {array.shape[1:]}, not ({width},)")
        # Tips of the frame itself, and the keys (key + 1) / 89 of its fingers; what follows are
        # those of the frames to come.
        columns = POINTS_SIZE + 2 * FINGER_COUNT
        action = _whole("action", action_array)[:, :columns]
        ends = _whole("episode_ends", end_array)
        Field("number", ("C",), 0, _MOST_FRAMES).check_values("episode_ends", ends)
        ends = ends.reshape(-1).astype(np.int64)
        keys_of_fingers = Field("number", (), 0, 1)
        keys_of_fingers.check_values("action", action[:, POINTS_SIZE:])
        _TIPS.check_values("action", action[:, :POINTS_SIZE])
    # A damaged store raises what its codecs and its metadata happen to raise.
    except Exception as error:
        raise InputError(f"{refusal} ({reason_of(error)})") from error
    if not len(ends) or (np.diff(ends, prepend=-1) <= 0).any() or ends[-1] != len(action) - 1:
        raise InputError(f"{refusal}: its clips do not end where its {len(action)} rows do")
    clips: list[_Clip] = []
    first = 0
    for end in ends:
        rows = action[first : end + 1]
        first = int(end) + 1
        tips = rows[:, :POINTS_SIZE].reshape(-1, 2, POINT_COUNT, 3).astype(np.float64)
        keys = np.rint(rows[:, POINTS_SIZE:] * (KEYS + 1)).astype(np.int64) - 1
        goal = np.zeros((len(rows), KEYS), bool)
        frame, _ = np.nonzero((keys >= 0) & (keys < KEYS))
        goal[frame, keys[(keys >= 0) & (keys < KEYS)]] = True
        clips.append(_Clip(tips, goal))
    return clips


def _whole(name: str, array: Any) -> NDArray[Any]:
    """A whole array of a zarr store; a chunk that is not there would read as zeros.

    Raises:
        InputError: a chunk is missing, or it is larger than any that was published.
    """
    sizes = [*array.shape, *array.chunks]
    if array.dtype.kind not in "fiu" or min(sizes, default=0) < 1 or max(sizes) > _MOST_FRAMES:
        raise InputError(f"{name} is of another type or size")
    if max(math.prod(array.shape), math.prod(array.chunks)) * array.dtype.itemsize > MOST_BYTES:
        raise InputError(f"{name} is larger than any that was published")
    if array.nchunks_initialized != array.nchunks:
        raise InputError(f"chunks of {name} are missing")
    return np.asarray(array[:])


def _arrays(path: Path, schema: Mapping[str, Field]) -> dict[str, NDArray[Any]]:
    try:
        return read_arrays(path, "an .npz file of published clips", schema)
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist") from None

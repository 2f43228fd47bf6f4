"""The first stage: which finger presses each key of the goal, frame by frame.

A high level that says places has to be right to less than the width of a key. One that says fingers
need not: where the keys are is known. The network decides for one key at a time, from the lowest
up, and sees the music relative to that key; so it learns from every key, and songs resemble each
other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, KEYS_PER_OCTAVE, NO_KEY
from pianomime.policies.policy import Inference
from pianomime.world.layout import FINGER_COUNT

FINGERS = 2 * FINGER_COUNT
"""Fingers of both hands, left thumb first."""
NOBODY = FINGERS
"""The choice that no finger presses a key."""
CHOICES = FINGERS + 1
"""Numbers of an action: the score of each finger, and of nobody, for one key."""
LOWEST = CHOICES
"""Stands for the choice of the key below where there is none in the goal."""
_AHEAD = (0, 1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 22, 26, 30)
"""Frames ahead in which the keys that sound are observed, and up to which those that are struck."""
GOALS = _AHEAD[-1] + 1
"""Frames of goals that are observed: the present one and those that follow."""
_REACH = 20
"""Keys on either side of the key that are observed one by one; others are counted."""
_SEEN = 2 * _REACH + 1
_MANY = 3.0
"""Unit of the numbers of keys further away."""
_HALF_OCTAVE = 6.0
"""Unit of distances to the keys that fingers pressed last [keys]; they are clipped to 6 units."""
_FORGET = 10.0
"""Time constant of the memory of when a finger pressed last [frames]."""
_QUARTER = KEYS / 4
"""Unit of the place on the keyboard [keys]."""
_PARTS = {
    "keys around": len(_AHEAD) * 2 * _SEEN,
    "keys below": len(_AHEAD) * 2,
    "keys above": len(_AHEAD) * 2,
    "fingers": FINGERS * 5,
    "name of the key": KEYS_PER_OCTAVE,
    "place": 1,
    "choice of the key below": CHOICES + 1,
    "fingers in use": FINGERS,
}
"""Parts of the observation of a key, in order, with their sizes."""
SIZE = sum(_PARTS.values())
"""Size of the observation of a key."""
_DECIDED = _PARTS["choice of the key below"] + _PARTS["fingers in use"]
"""Numbers of an observation, the last ones, that are known when the keys below have a finger."""


class Touched(NamedTuple):
    """What fingers pressed up to a frame, in B cases.

    Attributes:
        key: (B, 10) last key of each finger, -1 for none yet.
        since: (B, 10) frames since it was last down: 0 where it is.
    """

    key: NDArray[np.int64]
    since: NDArray[np.int64]

    @classmethod
    def before(cls, finger_key: NDArray[np.int8]) -> Touched:
        """Before each of the T frames in which fingers (T, 2, 5) press keys, -1 for none."""
        keys = finger_key.reshape(len(finger_key), FINGERS).astype(np.int64)
        frame = np.arange(len(keys))[:, None]
        last = np.maximum.accumulate(np.where(keys >= 0, frame, -1), axis=0)
        last = np.vstack([np.full((1, FINGERS), -1), last[:-1]])
        known = np.take_along_axis(keys, np.maximum(last, 0), axis=0)
        return cls(np.where(last >= 0, known, NO_KEY), frame - 1 - last)

    def then(self, finger_key: NDArray[np.int64]) -> Touched:
        """After one more frame, in which fingers (B, 10) press keys."""
        down = finger_key >= 0
        return Touched(np.where(down, finger_key, self.key), np.where(down, 0, self.since + 1))


def key_observation(
    goal: NDArray[np.bool_], touched: Touched, key: NDArray[np.int64]
) -> NDArray[np.float32]:
    """What is observed of B keys, but for what those below were given: zeros, see `decided`.

    Args:
        goal: (B, 1 + GOALS, 88) keys that should be down in the frame before, in this one, and in
            those that follow.
        touched: what the fingers pressed up to the frame before, in each case.
        key: (B,) a key of the goal.

    Returns:
        (B, SIZE).
    """
    struck = np.logical_or.reduceat(
        goal[:, 1:] & ~goal[:, :-1], [0, *(ahead + 1 for ahead in _AHEAD[:-1])], axis=1
    )
    sounds = goal[:, 1:][:, list(_AHEAD)]
    music = np.stack([sounds, struck], axis=2)
    padded = np.zeros((*music.shape[:-1], KEYS + 2 * _REACH), np.float32)
    padded[..., _REACH : _REACH + KEYS] = music
    seen = (key[:, None] + np.arange(_SEEN))[:, None, None]
    keys = np.arange(KEYS)
    away = [keys < key[:, None] - _REACH, keys > key[:, None] + _REACH]
    below, above = ((music & side[:, None, None]).sum(axis=-1) / _MANY for side in away)
    known = touched.key >= 0
    apart = np.clip((touched.key - key[:, None]) / _HALF_OCTAVE, -_HALF_OCTAVE, _HALF_OCTAVE)
    memory = np.where(known, np.exp(-touched.since / _FORGET), 0.0)
    fingers = np.stack(
        [
            np.where(known, apart, 0.0),
            known,
            known & (touched.since == 0),
            memory,
            known & (touched.key == key[:, None]),
        ],
        axis=2,
    )
    parts = {
        "keys around": np.take_along_axis(padded, seen, axis=3),
        "keys below": below,
        "keys above": above,
        "fingers": fingers,
        "name of the key": np.eye(KEYS_PER_OCTAVE)[key % KEYS_PER_OCTAVE],
        "place": (key - KEYS / 2) / _QUARTER,
    }
    rows = [part.reshape(len(key), -1) for part in parts.values()]
    return np.hstack([*rows, np.zeros((len(key), _DECIDED))]).astype(np.float32)


def decided(below: NDArray[np.int64], used: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(B, .) The last numbers of an observation: what the keys below in the goal were given.

    Args:
        below: (B,) choice for the next lower key of the goal; `LOWEST` where there is none.
        used: (B, 10) fingers that were given to keys below.
    """
    return np.hstack([np.eye(CHOICES + 1)[below], used]).astype(np.float32)


def decide(observation: NDArray[np.float32], decisions: NDArray[np.float32]) -> None:
    """Write `decided` (B, .) into observations (B, SIZE)."""
    observation[:, -_DECIDED:] = decisions


class FingeringRollout:
    """Asks the network for the fingers of each frame, in order; it sees what it said before.

    Args:
        roll: (T, 88) goals of a song; silence follows.
        policy: the network: `observation` (B, SIZE) to `action` (B, 1, CHOICES).
    """

    def __init__(self, roll: NDArray[np.bool_], policy: Inference) -> None:
        self._goal = np.pad(roll, ((1, GOALS), (0, 0)))
        self._policy = policy
        self._touched = Touched(*np.full((2, 1, FINGERS), NO_KEY))
        self._frame = 0

    def step(self) -> NDArray[np.int8]:
        """(2, 5) the key that each finger presses in the next frame, -1 for none."""
        pressed = np.full(FINGERS, NO_KEY)
        goal = self._goal[self._frame : self._frame + 1 + GOALS]
        over = len(goal) <= GOALS
        keys = np.empty(0, np.int64) if over else np.flatnonzero(goal[1])
        if len(keys):
            batch = len(keys)
            touched = Touched(*(np.repeat(part, batch, axis=0) for part in self._touched))
            seen = key_observation(np.repeat(goal[None], batch, axis=0), touched, keys)
            below, used = LOWEST, np.zeros(FINGERS, bool)
            for row, key in enumerate(keys):
                decide(seen[row : row + 1], decided(np.array([below]), used[None]))
                scores = self._policy({"observation": seen[row : row + 1]})[0][0, 0]
                below = int(np.where(np.append(used, False), -np.inf, scores).argmax())
                if below != NOBODY:
                    pressed[below], used[below] = key, True
        self._touched = self._touched.then(pressed[None])
        self._frame += 1
        return pressed.reshape(2, FINGER_COUNT).astype(np.int8)

"""One learned residual for every finger of every song, on what the dynamic tracker proposes.

All ten fingers share a policy. Each is told of its own surroundings alone, and left ones as if in a
mirror, so that there are ten times as many moments to learn from, and no song is unlike the others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, FRAME_SECONDS, KEYS
from pianomime.plan import FingertipPlan
from pianomime.plan.joint_path import resting_height
from pianomime.policies.policy import Inference
from pianomime.track import DynamicTracker
from pianomime.world import World
from pianomime.world.hand import both_hands
from pianomime.world.layout import LAYOUT
from pianomime.world.parameters import key_centres

ACTIONS = 5
"""Numbers that a finger says: of its actuators, of which some fingers have fewer."""
AMPLITUDE = 0.15
"""[rad] of an actuator for 1."""
_BEFORE, _AHEAD = 2, 5
"""Frames of its presses that a finger knows, before the present one and from it on."""
_JOINTS = 5
_CM = 0.01
_NEAR = 0.016
"""[m] along the keyboard from a fingertip within which keys are told to it."""
SIZE = 5 + 3 * (_BEFORE + _AHEAD) + 2 + 3 + 1 + 3 + 4 + 2 * _JOINTS + 2
"""Numbers that a finger is told."""


class FingerObservation:
    """What fingers are told, of one plan.

    Args:
        plan: which.
        tracker: that follows it, `begin` done.
    """

    def __init__(self, plan: FingertipPlan, tracker: DynamicTracker) -> None:
        self._tracker = tracker
        frames = len(plan)
        padded = np.full((frames + _BEFORE + _AHEAD, 2, 5), -1, np.int64)
        padded[_BEFORE : _BEFORE + frames] = plan.finger_key
        self._keys = padded
        self._goal = plan.keys()

    def look(
        self,
        frame: int,
        qpos: NDArray[np.float64],
        qvel_hands: NDArray[np.float64],
        key_state: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> NDArray[np.float32]:
        """(10, SIZE), left hand first.

        Args:
            frame: the next that is played.
            qpos: (142,) positions of everything [rad, m].
            qvel_hands: (54,) velocities of the hands [rad/s, m/s].
            key_state: (88,) how far each key is down.
            points: (2, 6, 3) where forearms and fingertips are [m].
        """
        aim, path = self._tracker.aim(frame)
        tips = points[:, 1:]
        mirror = np.array([-1.0, 1.0])[:, None]
        told = np.zeros((2, 5, SIZE), np.float32)
        told[..., :5] = np.eye(5)
        at = 5
        around = self._keys[frame : frame + _BEFORE + _AHEAD]
        now = around[_BEFORE]
        pressing = around >= 0
        beside = key_centres()[around, 1] - tips[None, ..., 1]
        width = _BEFORE + _AHEAD
        told[..., at : at + width] = pressing.transpose(1, 2, 0)
        at += width
        told[..., at : at + width] = (pressing & (around == now)).transpose(1, 2, 0)
        at += width
        off = np.where(pressing, np.clip(mirror * beside / _CM, -4.0, 4.0), 0.0)
        told[..., at : at + width] = off.transpose(1, 2, 0)
        at += width
        own = np.maximum(now, 0)
        told[..., at] = (now >= 0) & BLACK[own]
        told[..., at + 1] = np.where(now >= 0, key_state[own], 0.0)
        at += 2
        error = aim - tips
        error[..., 1] *= mirror
        told[..., at : at + 3] = np.clip(error / _CM, -4.0, 4.0)
        at += 3
        told[..., at] = np.clip((tips[..., 2] - resting_height(tips[..., 0])) / _CM, -3.0, 5.0)
        at += 1
        # Keys under it that nobody wants, on the one side and the other, and where it stands on.
        apart = (key_centres()[:, 1] - tips[..., None, 1]) * mirror[..., None]
        close = np.abs(apart) < _NEAR
        unwanted = np.where(close & ~self._goal[frame], key_state, 0.0)
        told[..., at] = np.where(apart < 0, unwanted, 0.0).max(axis=2)
        told[..., at + 1] = np.where(apart >= 0, unwanted, 0.0).max(axis=2)
        told[..., at + 2] = tips[..., 0] / 0.05
        at += 3
        neighbours = np.zeros((2, 7))
        neighbours[:, 1:6] = now >= 0
        soon = np.zeros((2, 7))
        soon[:, 1:6] = pressing[_BEFORE + 1]
        for index, row in enumerate((neighbours, soon)):
            told[..., at + 2 * index] = row[:, :5]
            told[..., at + 2 * index + 1] = row[:, 2:]
        at += 4
        for index in range(2):
            hand = both_hands()[index]
            joints = qpos[hand.joints]
            first = hand.joints.start - KEYS
            velocity = qvel_hands[first : first + LAYOUT.hand_joints]
            for finger, which in enumerate(LAYOUT.finger_joints):
                size = which.stop - which.start
                row = told[index, finger]
                row[at : at + size] = (path[index, which] - joints[which]) / 0.2
                row[at + _JOINTS : at + _JOINTS + size] = velocity[which] * FRAME_SECONDS / 0.2
            # Along the keyboard forearms slide alike, not as in a mirror.
            slide = np.array([path[index, 0] - joints[0], velocity[0] * FRAME_SECONDS])
            told[index, :, at + 2 * _JOINTS :] = np.clip(mirror[index] * slide / _CM, -4.0, 4.0)
        return told.reshape(10, SIZE)


def controls(said: NDArray[np.floating]) -> NDArray[np.float64]:
    """(46,) what fingers' actions (10, 5), -1..1, add to controls [rad]."""
    added = np.zeros(46)
    for row, action in enumerate(np.clip(said, -1.0, 1.0)):
        hand, which = both_hands()[row // 5], LAYOUT.finger_actuators[row % 5]
        mine = added[hand.actuators]
        mine[which] = AMPLITUDE * action[: which.stop - which.start]
    return added


class FingerResidualTracker:
    """The dynamic tracker, and what a policy adds to it.

    Args:
        run: the policy: `told` (10, SIZE) to actions (10, 5).
    """

    def __init__(self, run: Inference) -> None:
        self._run, self._tracker = run, DynamicTracker()

    def begin(self, plan: FingertipPlan) -> None:
        """Prepare the dynamic tracker."""
        self._tracker.begin(plan)
        self._surroundings = FingerObservation(plan, self._tracker)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left."""
        proposed, points = self._tracker.controls(np.array([frame]), world.qpos[None])
        told = self._surroundings.look(
            frame, world.qpos, world.qvel_hands, world.key_state, points[0]
        )
        ctrl: NDArray[np.float64] = proposed[0] + controls(self._run({"told": told})[0])
        return ctrl

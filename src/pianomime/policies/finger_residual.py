"""The finger residual: one policy for every finger of every song, on top of the dynamic tracker.

All ten fingers share a policy. Each observes its own surroundings alone, and left fingers observe
them mirrored: so ten samples come of every state, and songs resemble each other.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, FRAME_SECONDS, NO_KEY
from pianomime.plan import FingertipPlan
from pianomime.plan.joint_path import resting_height
from pianomime.policies.policy import Inference
from pianomime.track import DynamicTracker
from pianomime.track.dynamic import DynamicController
from pianomime.world import World
from pianomime.world.hand import both_hands
from pianomime.world.layout import FINGER_COUNT, LAYOUT
from pianomime.world.parameters import key_centres

AGENTS = 2 * FINGER_COUNT
"""Fingers that share the policy, left thumb first."""
ACTIONS = max(part.stop - part.start for part in LAYOUT.finger_actuators)
"""Size of a finger's action: its actuators; fingers with fewer ignore the rest."""
AMPLITUDE = 0.15
"""Residual of an actuator for an action of 1 [rad]."""
_BEFORE, _AHEAD = 2, 5
"""Frames of its presses that a finger observes: before the present one, and from it on."""
_JOINTS = max(part.stop - part.start for part in LAYOUT.finger_joints)
_NEAR = 0.016
"""A finger observes unwanted keys within this distance along the keyboard [m]."""
_LENGTH = 0.01
"""Unit of lengths [m]; they are clipped to 4 units (heights to -3..5)."""
_DEPTH = 0.05
"""Unit of the place along the key [m]."""
_ANGLE = 0.2
"""Unit of joint angles, and of the angle that a joint turns in a frame [rad]."""
_PARTS = {
    "finger": FINGER_COUNT,
    "presses": _BEFORE + _AHEAD,
    "presses its present key": _BEFORE + _AHEAD,
    "distance to keys": _BEFORE + _AHEAD,
    "key is black": 1,
    "key state": 1,
    "tip error": 3,
    "height": 1,
    "unwanted keys": 2,
    "place along the key": 1,
    "neighbours press": 2,
    "neighbours press next": 2,
    "joint errors": _JOINTS,
    "joint velocities": _JOINTS,
    "forearm": 2,
}
"""Parts of a finger's observation, in order, with their sizes."""
SIZE = sum(_PARTS.values())
"""Size of a finger's observation."""
_MIRROR = np.array([-1.0, 1.0])[:, None]


class FingerObservation:
    """Encodes the observations of all fingers that follow one plan.

    Args:
        controller: the dynamic controller of the plan.
    """

    def __init__(self, controller: DynamicController) -> None:
        plan = controller.plan
        self._controller = controller
        around = np.full((len(plan) + _BEFORE + _AHEAD, 2, FINGER_COUNT), NO_KEY, np.int64)
        around[_BEFORE : _BEFORE + len(plan)] = plan.finger_key
        self._keys = around
        self._goal = plan.keys()

    def encode(
        self,
        frame: int,
        qpos: NDArray[np.float64],
        qvel_hands: NDArray[np.float64],
        key_state: NDArray[np.float64],
        points: NDArray[np.float64],
    ) -> NDArray[np.float32]:
        """The observations (10, SIZE) before a frame, left thumb first.

        Args:
            frame: the next that is played.
            qpos: (142,) positions of keys and hands [rad, m].
            qvel_hands: (54,) velocities of the hands, right then left [rad/s, m/s].
            key_state: (88,) how far each key is down, 0..1.
            points: (2, 6, 3) wrists and fingertips [m].
        """
        aim, path = self._controller.aim(frame)
        tips = points[:, 1:]
        along = key_centres()[:, 1]
        around = self._keys[frame : frame + _BEFORE + _AHEAD]
        pressing = around >= 0
        now = around[_BEFORE]
        own = np.maximum(now, 0)
        beside = _clip(_MIRROR * (along[around] - tips[None, ..., 1]))
        error = aim - tips
        error[..., 1] *= _MIRROR
        apart = (along - tips[..., None, 1]) * _MIRROR[..., None]
        unwanted = np.where((np.abs(apart) < _NEAR) & ~self._goal[frame], key_state, 0.0)
        parts = {
            "finger": np.broadcast_to(np.eye(FINGER_COUNT), (2, FINGER_COUNT, FINGER_COUNT)),
            "presses": pressing.transpose(1, 2, 0),
            "presses its present key": (pressing & (around == now)).transpose(1, 2, 0),
            "distance to keys": np.where(pressing, beside, 0.0).transpose(1, 2, 0),
            "key is black": ((now >= 0) & BLACK[own])[..., None],
            "key state": np.where(now >= 0, key_state[own], 0.0)[..., None],
            "tip error": _clip(error),
            "height": _clip(tips[..., 2:] - resting_height(tips[..., :1]), -3.0, 5.0),
            "unwanted keys": np.stack(
                [np.where(side, unwanted, 0.0).max(axis=2) for side in (apart < 0, apart >= 0)],
                axis=2,
            ),
            "place along the key": tips[..., :1] / _DEPTH,
            "neighbours press": _of_neighbours(now >= 0),
            "neighbours press next": _of_neighbours(pressing[_BEFORE + 1]),
            **self._joints(qpos, qvel_hands, path),
        }
        row = np.concatenate([parts[name] for name in _PARTS], axis=2)
        return row.astype(np.float32).reshape(AGENTS, SIZE)

    def _joints(
        self,
        qpos: NDArray[np.float64],
        qvel_hands: NDArray[np.float64],
        path: NDArray[np.float64],
    ) -> dict[str, NDArray[np.float64]]:
        """The parts that are about joints, given their reference (2, 27) [rad, m]."""
        errors, velocities = np.zeros((2, 2, FINGER_COUNT, _JOINTS))
        forearm = np.empty((2, FINGER_COUNT, 2))
        for index in range(2):
            error = path[index] - qpos[LAYOUT.joints[index]]
            velocity = qvel_hands[LAYOUT.among_hands(index)]
            for finger, joints in enumerate(LAYOUT.finger_joints):
                size = joints.stop - joints.start
                errors[index, finger, :size] = error[joints] / _ANGLE
                velocities[index, finger, :size] = velocity[joints] * FRAME_SECONDS / _ANGLE
            # Along the keyboard both forearms slide the same way: only this is mirrored by hand.
            slide = np.array([error[LAYOUT.slide], velocity[LAYOUT.slide] * FRAME_SECONDS])
            forearm[index] = _clip(_MIRROR[index] * slide)
        return {"joint errors": errors, "joint velocities": velocities, "forearm": forearm}


def controls(actions: NDArray[np.floating]) -> NDArray[np.float64]:
    """The residual (46,) [rad] of actions (10, 5); actions beyond -1..1 are clipped."""
    added = np.zeros(LAYOUT.ctrl_size)
    for agent, action in enumerate(np.clip(actions, -1.0, 1.0)):
        hand, finger = divmod(agent, FINGER_COUNT)
        actuators = LAYOUT.finger_actuators[finger]
        mine = added[both_hands()[hand].actuators]
        mine[actuators] = AMPLITUDE * action[: actuators.stop - actuators.start]
    return added


class FingerResidualTracker:
    """The dynamic tracker, and the residual that the finger policy adds.

    Args:
        policy: the network: `observation` (10, SIZE) to actions (10, 5).
        base: the dynamic tracker; with the settings of `zero-shot-20hz` if None.
    """

    def __init__(self, policy: Inference, base: DynamicTracker | None = None) -> None:
        self._policy, self._base = policy, base or DynamicTracker()

    def start(self, plan: FingertipPlan) -> FingerResidualController:
        """A controller of a plan."""
        return FingerResidualController(self._base.start(plan), self._policy)


class FingerResidualController:
    """Adds the finger policy's residual to a dynamic controller.

    Args:
        base: the dynamic controller.
        policy: the network.
    """

    replayable: ClassVar[bool] = True

    def __init__(self, base: DynamicController, policy: Inference) -> None:
        self.plan = base.plan
        self._base, self._policy = base, policy
        self._observation = FingerObservation(base)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left [rad, m]."""
        base, points = self._base.controls(np.array([frame]), world.qpos[None])
        observation = self._observation.encode(
            frame, world.qpos, world.qvel_hands, world.key_state, points[0]
        )
        actions = self._policy({"observation": observation})[0]
        ctrl: NDArray[np.float64] = base[0] + controls(actions)
        return ctrl


def _clip(length: NDArray[np.float64], low: float = -4.0, high: float = 4.0) -> NDArray[np.float64]:
    """Lengths [m] in their unit, clipped."""
    clipped: NDArray[np.float64] = np.clip(length / _LENGTH, low, high)
    return clipped


def _of_neighbours(pressing: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(2, 5, 2) what holds (2, 5) for the finger before and the finger after each."""
    padded = np.zeros((2, FINGER_COUNT + 2))
    padded[:, 1:-1] = pressing
    return np.stack([padded[:, :-2], padded[:, 2:]], axis=2)

"""Closed-loop play in three stages: the fingers, the fingertips, the controls."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.policies.fingertip_policy import PlanRecord
from pianomime.policies.policy import Inference
from pianomime.policies.three_stage.fingering import FingeringRollout
from pianomime.policies.three_stage.hand_controls import (
    TARGETS,
    controls_observation,
    controls_of_action,
)
from pianomime.policies.three_stage.hand_motion import HandMotionRollout
from pianomime.short_repr import short_repr
from pianomime.world import World
from pianomime.world.hand import both_hands, hand_points
from pianomime.world.layout import LAYOUT


@dataclass(frozen=True, eq=False)
class Stages:
    """The networks of the three stages.

    Attributes:
        fingering: see `FingeringRollout`.
        motion: see `HandMotionRollout`.
        controls: `observation` (2, SIZE) of `controls_observation` to `action` (2, 1, 23).
    """

    fingering: Inference
    motion: Inference
    controls: Inference

    __repr__ = short_repr


class ThreeStageController:
    """Decides fingers and fingertips some frames ahead, and controls by the state of the hands.

    Args:
        score: what is played.
        stages: the networks.
    """

    replayable: ClassVar[bool] = False

    def __init__(self, score: Score, stages: Stages) -> None:
        self._controls = stages.controls
        fingering = FingeringRollout(score.roll(), stages.fingering)
        self._motion = HandMotionRollout(fingering, stages.motion)
        self._record, self._frames = PlanRecord(score), score.frames()
        self._ahead: deque[tuple[NDArray[np.float64], NDArray[np.int8]]] = deque()

    @property
    def plan(self) -> FingertipPlan:
        """The fingers and fingertips that were decided for the frames so far."""
        return self._record.plan()

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left [rad, m]; frames come in order, each once."""
        while len(self._ahead) < TARGETS:
            self._ahead.append(self._motion.step())
        self._record.write(frame, *self._ahead[0])
        targets, presses = (np.stack(rows, axis=1) for rows in zip(*self._ahead, strict=True))
        self._ahead.popleft()
        side = np.arange(2)
        hands = [LAYOUT.among_hands(hand) for hand in range(2)]
        joints, velocities = (
            np.stack([both[hand] for hand in hands])
            for both in (world.qpos_hands, world.qvel_hands)
        )
        observation = controls_observation(
            joints,
            velocities,
            np.repeat(world.key_state[None], 2, axis=0),
            hand_points(world.qpos_hands[None])[0],
            targets,
            presses,
            side,
        )
        action = self._controls({"observation": observation})[0][:, 0]
        ctrl = np.empty(LAYOUT.ctrl_size)
        for hand, mine in zip(both_hands(), controls_of_action(action, joints, side), strict=True):
            ctrl[hand.actuators] = mine
        return ctrl

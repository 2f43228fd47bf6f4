"""Where joints and actuators stand in the arrays of a World, read from the compiled model.

Positions are those of the keys, then of the right hand, then of the left hand; controls are those
of the right hand, then of the left hand. Pairs per hand are (left, right), as in a plan.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from pianomime.world.model import FINGER_PREFIXES, SIDES, world_model

POINT_COUNT = 1 + len(FINGER_PREFIXES)
"""Points of a hand in plans and observations: the wrist, then the fingertips, thumb first."""
FINGER_COUNT = len(FINGER_PREFIXES)
"""Fingers of a hand."""
POINTS_SIZE = 2 * POINT_COUNT * 3
"""Coordinates of the points of both hands, (2, 6, 3), as one row."""
TIPS_SIZE = 2 * FINGER_COUNT * 3
"""Coordinates of the fingertips of both hands, (2, 5, 3), as one row."""


@dataclass(frozen=True)
class Layout:
    """Sizes and index ranges of one model, whose two hands have the same joints and actuators.

    Attributes:
        keys: number of keys, which come first in the positions.
        qpos_size: number of positions, of keys and hands.
        ctrl_size: number of controls, of both hands.
        hand_joints: number of joints of one hand.
        hand_actuators: number of actuators of one hand.
        joints: (left, right) range of each hand's joints in the positions.
        actuators: (left, right) range of each hand's actuators in the controls.
        finger_joints: range of each finger's joints within its hand, thumb first.
        finger_actuators: range of each finger's actuators within its hand, thumb first.
        slides: range of the forearm's slides within the joints of a hand: along the keyboard,
            toward the piano, up.
        wrist: range of the wrist's joints within the joints of a hand.
        slide_actuators: range of the slides' actuators within those of a hand.
        wrist_actuators: range of the wrist's actuators within those of a hand.
        coupled: pairs of joints of a hand that one tendon couples.
        joint_names: names of a hand's joints, without the side.
        actuator_names: names of a hand's actuators, without the side.
    """

    keys: int
    qpos_size: int
    ctrl_size: int
    hand_joints: int
    hand_actuators: int
    joints: tuple[slice, slice]
    actuators: tuple[slice, slice]
    finger_joints: tuple[slice, ...]
    finger_actuators: tuple[slice, ...]
    slides: slice
    wrist: slice
    slide_actuators: slice
    wrist_actuators: slice
    coupled: tuple[tuple[int, int], ...]
    joint_names: tuple[str, ...]
    actuator_names: tuple[str, ...]

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Layout:
        """Read the layout of a compiled model.

        Args:
            model: piano and both hands, with names as `build_spec` gives them.

        Raises:
            ValueError: joints or actuators that belong together are not contiguous, or the two
                hands differ.
        """
        joints = [model.joint(index).name for index in range(model.njnt)]
        actuators = [model.actuator(index).name for index in range(model.nu)]
        joint_ranges = tuple(_contiguous(joints, f"{side}_") for side in SIDES)
        actuator_ranges = tuple(_contiguous(actuators, f"{side}_") for side in SIDES)
        hand, driven = (
            _names_of_both(names, ranges)
            for names, ranges in ((joints, joint_ranges), (actuators, actuator_ranges))
        )
        return cls(
            keys=sum(name.startswith("key_") for name in joints),
            qpos_size=model.nq,
            ctrl_size=model.nu,
            hand_joints=len(hand),
            hand_actuators=len(driven),
            joints=(joint_ranges[0], joint_ranges[1]),
            actuators=(actuator_ranges[0], actuator_ranges[1]),
            finger_joints=tuple(_contiguous(hand, finger.upper()) for finger in FINGER_PREFIXES),
            finger_actuators=tuple(
                _contiguous(driven, finger.upper()) for finger in FINGER_PREFIXES
            ),
            slides=_contiguous(hand, "forearm"),
            wrist=_contiguous(hand, "WR"),
            slide_actuators=_contiguous(driven, "forearm"),
            wrist_actuators=_contiguous(driven, "WR"),
            coupled=_coupled_joints(model, joint_ranges[0]),
            joint_names=tuple(hand),
            actuator_names=tuple(driven),
        )

    @property
    def hands_size(self) -> int:
        """Number of positions of both hands, which follow those of the keys."""
        return 2 * self.hand_joints

    @property
    def arm_joints(self) -> int:
        """Number of joints of forearm and wrist, which come first in a hand."""
        return int(self.wrist.stop)

    @property
    def slide(self) -> int:
        """Index of the slide along the keyboard within the joints of a hand."""
        return int(self.slides.start)

    @property
    def arm_actuators(self) -> list[int]:
        """Indices of the actuators of wrist and forearm within those of a hand."""
        parts = (self.wrist_actuators, self.slide_actuators)
        return [index for part in parts for index in range(part.start, part.stop)]

    def among_hands(self, hand: int) -> slice:
        """Range of a hand's joints in the positions of both hands without the keys.

        Args:
            hand: 0 left, 1 right.
        """
        joints = self.joints[hand]
        return slice(joints.start - self.keys, joints.stop - self.keys)


def _contiguous(names: list[str], prefix: str) -> slice:
    """The range of the names with a prefix."""
    indices = [index for index, name in enumerate(names) if name.startswith(prefix)]
    if not indices or indices != list(range(indices[0], indices[-1] + 1)):
        raise ValueError(f"names that begin with {prefix!r} are not contiguous: {indices}")
    return slice(indices[0], indices[-1] + 1)


def _names_of_both(names: list[str], ranges: tuple[slice, ...]) -> list[str]:
    """The names of each hand without the side, the same for both."""
    left, right = (
        [name.removeprefix(f"{side}_") for name in names[part]]
        for side, part in zip(SIDES, ranges, strict=True)
    )
    if left != right:
        raise ValueError(f"the hands differ: {left} and {right}")
    return left


def _coupled_joints(model: mujoco.MjModel, joints: slice) -> tuple[tuple[int, int], ...]:
    """Pairs of joints of one hand that a tendon couples, by their index within the hand."""
    pairs = []
    for tendon in range(model.ntendon):
        first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
        wrapped = sorted(model.wrap_objid[first : first + count].tolist())
        if wrapped[0] in range(joints.start, joints.stop):
            one, other = (index - joints.start for index in wrapped)
            pairs.append((one, other))
    return tuple(sorted(pairs))


LAYOUT = Layout.of(world_model())
"""The layout of the world that all players play in."""

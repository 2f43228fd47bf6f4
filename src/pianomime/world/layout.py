"""Where joints and actuators of the robot stand in the arrays of a World, read off the model.

Positions are those of the keys, then of the right and of the left hand; controls are those of the
right and of the left hand. Everything that is told per hand is (left, right), as in a plan.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from pianomime.world.model import FINGER_PREFIXES, SIDES, Side, world_model

POINT_COUNT = 1 + len(FINGER_PREFIXES)
"""Points of a hand that plans and observations tell: wrist, then fingertips, thumb first."""
FINGER_COUNT = len(FINGER_PREFIXES)
POINTS_SIZE = 2 * POINT_COUNT * 3
"""Numbers of the points of both hands in a row, (2, 6, 3)."""
TIPS_SIZE = 2 * FINGER_COUNT * 3
"""Numbers of the fingertips of both hands in a row, (2, 5, 3)."""


@dataclass(frozen=True)
class Layout:
    """Sizes and places of one model; both hands are alike, mirrored.

    Attributes:
        keys: number of keys, which come first in the positions.
        qpos_size: positions of keys and hands.
        ctrl_size: controls of both hands.
        hand_joints, hand_actuators: of one hand.
        joints: (left, right) place of each hand's joints in the positions.
        actuators: (left, right) place of each hand's actuators in the controls.
        finger_joints: place of each finger's joints among those of its hand, thumb first.
        finger_actuators: the same of its actuators.
        slides: place of the forearm's slides among the joints of a hand: along the keyboard,
            toward the piano, up.
        wrist: place of the wrist's joints.
        slide_actuators, wrist_actuators: their actuators.
        coupled: pairs of joints of a hand that hang on one tendon.
        joint_names, actuator_names: of one hand, without the side.
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
        """The layout of a compiled model.

        Args:
            model: piano and both hands, as `build_spec` names them.

        Raises:
            ValueError: joints that belong together do not stand together.
        """
        joints = [model.joint(index).name for index in range(model.njnt)]
        actuators = [model.actuator(index).name for index in range(model.nu)]
        mine = _of_side(joints, "rh")
        drives = _of_side(actuators, "rh")
        hand = [joints[index].removeprefix("rh_") for index in range(mine.start, mine.stop)]
        driven = [
            actuators[index].removeprefix("rh_") for index in range(drives.start, drives.stop)
        ]
        coupled = []
        for tendon in range(model.ntendon):
            first, count = int(model.tendon_adr[tendon]), int(model.tendon_num[tendon])
            wrapped = model.wrap_objid[first : first + count].tolist()
            if wrapped[0] in range(mine.start, mine.stop):
                one, other = sorted(index - mine.start for index in wrapped)
                coupled.append((one, other))
        return cls(
            keys=sum(name.startswith("key_") for name in joints),
            qpos_size=model.nq,
            ctrl_size=model.nu,
            hand_joints=len(hand),
            hand_actuators=len(driven),
            joints=(_of_side(joints, SIDES[0]), _of_side(joints, SIDES[1])),
            actuators=(_of_side(actuators, SIDES[0]), _of_side(actuators, SIDES[1])),
            finger_joints=tuple(_together(hand, finger.upper()) for finger in FINGER_PREFIXES),
            finger_actuators=tuple(_together(driven, finger.upper()) for finger in FINGER_PREFIXES),
            slides=_together(hand, "forearm"),
            wrist=_together(hand, "WR"),
            slide_actuators=_together(driven, "forearm"),
            wrist_actuators=_together(driven, "WR"),
            coupled=tuple(sorted(coupled)),
            joint_names=tuple(hand),
            actuator_names=tuple(driven),
        )

    @property
    def hands_size(self) -> int:
        """Positions of both hands, which follow the keys."""
        return 2 * self.hand_joints

    @property
    def arm_joints(self) -> int:
        """Joints of forearm and wrist, which come first in a hand."""
        return self.wrist.stop

    @property
    def slide(self) -> int:
        """Place of the slide along the keyboard among the joints of a hand."""
        return self.slides.start

    @property
    def arm_actuators(self) -> list[int]:
        """Places of the actuators of wrist and forearm among those of a hand."""
        return [
            place
            for part in (self.wrist_actuators, self.slide_actuators)
            for place in range(part.start, part.stop)
        ]

    def among_hands(self, hand: int) -> slice:
        """Place of a hand's joints among those of both hands, which come without the keys.

        Args:
            hand: 0 left, 1 right.
        """
        joints = self.joints[hand]
        return slice(joints.start - self.keys, joints.stop - self.keys)


def _of_side(names: list[str], side: Side) -> slice:
    return _together(names, f"{side}_")


def _together(names: list[str], prefix: str) -> slice:
    """The unbroken run of names with a prefix."""
    places = [place for place, name in enumerate(names) if name.startswith(prefix)]
    if not places or places != list(range(places[0], places[-1] + 1)):
        raise ValueError(f"what begins with {prefix!r} does not stand together: {places}")
    return slice(places[0], places[-1] + 1)


LAYOUT = Layout.of(world_model())
"""The layout of the world that is played in."""

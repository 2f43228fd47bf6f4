"""Nominal tracking: feedback keeps the hands on the motion that was found in the nominal world.

What a player sends in the world that it knows moves the hands along a path. Where the world
differs, the hands leave it: masses and gains are others, and a controller that chose its controls
by simulation knows nothing of that. This one looks at the hands every 5 ms and brings them back,
by proportional and integral feedback of filtered measurements. A known delay is planned for: the
path is known before it is played, so controls are sent as much earlier as they act later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.short_repr import short_repr
from pianomime.track.calibration import hand_along
from pianomime.validation import above_zero, finite, multiple
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES
from pianomime.world.parameters import PHYSICS_DT, SUBSTEPS
from pianomime.world.perturbation import Sensors
from pianomime.world_names import PAPER


@dataclass(frozen=True)
class NominalTrackingConfig:
    """Settings of the feedback."""

    proportional: float = 1.0
    """Gain of the present errors of joints."""
    integral: float = 2.0
    """Gain of their integral [1/s]."""
    most: float = 0.2
    """Most that the integral adds to a joint's target [rad]."""
    most_slide: float = 0.02
    """Most that it adds to a slide's target [m]."""
    filter: float = 1.5
    """Time constant of the filter of all errors, those of slides too, by the standard deviation of
    the joints' noise alone [s/rad]: where joints are measured exactly, nothing is filtered,
    however noisy the slides are."""
    settle: float = 0.5
    """Time for which the hands are held at rest before the song [s]; whole frames of 0.05 s, so
    that those of the song begin where the world's do."""

    def __post_init__(self) -> None:
        finite(self)
        multiple("settle", self.settle, FRAME_SECONDS)
        for name in ("most", "most_slide"):
            above_zero(name, getattr(self, name))


@dataclass(frozen=True, eq=False)
class Reference:
    """What the hands do in the nominal world, in N > 0 physics steps of 5 ms.

    Attributes:
        ctrl: (N, 46) controls, right then left hand [rad, m].
        path: (N + 1, 54) positions of the hands before each step and after the last [rad, m].
    """

    ctrl: NDArray[np.float64]
    path: NDArray[np.float64]

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check it.

        Raises:
            ValueError: there is no physics step, or `path` does not belong to `ctrl`.
        """
        if not len(self.ctrl):
            raise ValueError("a reference needs at least one frame")
        if len(self.path) != len(self.ctrl) + 1:
            raise ValueError(
                f"a path of {len(self.ctrl)} steps has {len(self.ctrl) + 1} rows, not "
                f"{len(self.path)}"
            )

    @classmethod
    def of(cls, ctrl: NDArray[np.float64], world: str = PAPER) -> Reference:
        """Play controls from the rest pose.

        Where the physics breaks, the path goes on at once in the pose into which the world puts
        the hands, not in that of MuJoCo's reset, in which they never were.

        Args:
            ctrl: (T, S, 46), S in each of T frames.
            world: name of the nominal world.

        Raises:
            InputError: there is no such world.
            ValueError: `ctrl` has another shape or no frames, or is not finite.
        """
        if ctrl.ndim != 3 or not ctrl.shape[1]:
            raise ValueError(f"ctrl must be (T, S, {LAYOUT.ctrl_size}), not {ctrl.shape}")
        nominal, parts = World(world, quiet=True), ctrl.shape[1]
        path = [nominal.qpos_hands]
        lost: list[int] = []

        def watch() -> None:
            if nominal.broken:
                lost.append(len(path))
            path.append(nominal.qpos_hands)

        # Control by control: the hands are put back at the end of each one that broke.
        for target in ctrl.reshape(-1, ctrl.shape[2]):
            nominal.step(target, watch=watch, parts=parts)
            for step in lost:
                path[step] = nominal.qpos_hands
            lost.clear()
        every_step = np.repeat(ctrl, SUBSTEPS // parts, axis=1)
        return cls(every_step.reshape(-1, LAYOUT.ctrl_size), np.array(path))


class NominalTrackingController:
    """Keeps the hands on a reference, with a control for each physics step.

    It knows the reference, how noisy its sensors are, by how much controls act late, and where the
    keys are said to be; nothing else of the world that it plays in.

    Args:
        reference: what the hands do in the nominal world.
        sensors: by which it looks at the hands.
        config: settings.
        delay: physics steps from when a control is sent to when it acts.
        aside: by how much all keys lie further to the treble than in the nominal world [m].
    """

    replayable = False
    plan = None
    controls_per_frame = SUBSTEPS

    def __init__(
        self,
        reference: Reference,
        sensors: Sensors,
        config: NominalTrackingConfig | None = None,
        delay: int = 0,
        aside: float = 0.0,
    ) -> None:
        self.config = config or NominalTrackingConfig()
        self._reference, self._sensors, self._delay = reference, sensors, delay
        self._to_ctrl = np.zeros((LAYOUT.ctrl_size, LAYOUT.hands_size))
        self._shift = np.zeros(LAYOUT.hands_size)
        self._most = np.full(LAYOUT.hands_size, self.config.most)
        for index, hand in enumerate(Hand(side) for side in SIDES):
            joints = LAYOUT.among_hands(index)
            self._to_ctrl[hand.actuators, joints] = hand.to_ctrl
            self._shift[joints] = aside * hand_along(hand)
            self._most[joints][LAYOUT.slides] = self.config.most_slide
        smoothing = self.config.filter * sensors.joint_noise
        self._share = 1.0 - np.exp(-PHYSICS_DT / smoothing) if smoothing else 1.0
        self._error = np.zeros(LAYOUT.hands_size)
        self._integral = np.zeros(LAYOUT.hands_size)

    def settle(self, world: World) -> None:
        """Hold the hands at rest for a while, then play the world up to where the song begins.

        Args:
            world: at rest; it is stepped.
        """
        for step in range(-round(self.config.settle / PHYSICS_DT), 0):
            world.step(self.control(step, world), parts=SUBSTEPS)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left: that of the reference, and what the errors ask for.

        Args:
            frame: number of the physics step; before 0 the hands are at rest.
            world: as it is before it; only its sensors are read.
        """
        reference, config = self._reference, self.config
        measured = self._sensors.measure(world) - self._shift
        self._error += self._share * (reference.path[max(frame, 0)] - measured - self._error)
        self._integral += config.integral * PHYSICS_DT * self._error
        np.clip(self._integral, -self._most, self._most, out=self._integral)
        acts = frame + self._delay
        sent = np.zeros(LAYOUT.ctrl_size)
        if acts >= 0:
            sent = reference.ctrl[min(acts, len(reference.ctrl) - 1)]
        move = self._shift + config.proportional * self._error + self._integral
        ctrl: NDArray[np.float64] = sent + self._to_ctrl @ move
        return ctrl

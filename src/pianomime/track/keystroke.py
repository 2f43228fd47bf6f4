"""The keystroke tracker: hands follow a path over the keys, and fingers strike at their own times.

As the dynamic tracker does, it sends the joint positions whose springs give the torques that the
wanted motion needs. But it sends several controls a frame, looks at the hands before each, and
moves every finger by the strokes of its strikes: when a note begins within a frame, and how loud it
is, is up to the score.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan import FingertipPlan
from pianomime.plan.joint_path import KEY_REST, PathConfig, PathProblem, resting_height
from pianomime.plan.keep_apart import smooth_paths
from pianomime.plan.strikes import Strikes
from pianomime.progress import Steps, ignore
from pianomime.short_repr import short_repr
from pianomime.track.dynamic import motion_torque, to_actuators
from pianomime.track.finger_feedback import lift_joints, reach_joints, shared
from pianomime.track.strokes import Corrections, StrokeConfig, strokes_of
from pianomime.validation import finite, whole_numbers, within
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import FINGER_COUNT, LAYOUT, POINT_COUNT
from pianomime.world.model import SIDES
from pianomime.world.parameters import SUBSTEPS, key_centres, key_half_sizes
from pianomime.world_names import PAPER

# Errors of the path at which their cost is 1 [m].
_WRIST_TOLERANCE = 0.05  # along the keyboard; the others do not count
_HOVER_TOLERANCE = 0.004
_PRESS_TOLERANCE = np.array([0.004, 0.0015, 0.001])  # along x, y, z


@dataclass(frozen=True)
class KeystrokeConfig:
    """Settings of the keystroke tracker."""

    controls: int = 5
    """Controls a frame; a frame has 10 physics steps, which they must divide."""
    stroke: StrokeConfig = field(default_factory=StrokeConfig)
    """How keys are struck."""
    path: PathConfig = field(default_factory=PathConfig)
    """Weights of the path of the hands."""
    refine: int = 3
    """Gauss-Newton steps of the path with all controls, after one with frames alone."""
    again: int = 2
    """Gauss-Newton steps of the path when its strokes were corrected."""
    joint_feedback: float = 0.3
    """Gain of the joint-position feedback of wrists and fingers."""
    slide_feedback: float = 0.8
    """Gain of the joint-position feedback of the forearms' slides."""
    tip_feedback: float = 0.5
    """Gain of the fingertip-position feedback on the finger's own joints."""
    tip_damping: float = 0.03
    """Damping of the fingertip-position feedback [m/rad]."""
    tip_error: float = 0.02
    """Fingertip errors are clipped to this length [m]."""
    astray: float = 0.009
    """A finger further than this beside its key does not press, but is lifted [m]."""
    sunk: float = 0.005
    """An idle fingertip further than this below the tops of the keys is lifted [m]."""
    clear: float = 0.024
    """Height by which such fingers are lifted [m]."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        finite(self)
        within("controls", self.controls, 1, SUBSTEPS)
        if SUBSTEPS % self.controls:
            raise InputError(f"controls must divide {SUBSTEPS}, not be {self.controls}")


@dataclass(frozen=True, eq=False)
class Continuation:
    """What a controller that begins in the middle of a piece goes on from.

    Attributes:
        poses: (left, right) (S + 1, 27) joint positions at the ends of the S controls of the frame
            before the first, the last of them at its end [rad, m].
        planned: (left, right) (n, 27) joint positions at the ends of the first n controls, as they
            were planned before what follows was known [rad, m].
        fingertips: (2, 6, 3) points of the plan in the frame before the first, world frame [m].
        pressing: (2, 5) bool, fingers that press then.
        x: (M,) world x at which each strike of the plan is struck [m]; NaN for those that the plan
            itself has, because they have not begun.
    """

    poses: list[NDArray[np.float64]]
    planned: list[NDArray[np.float64]]
    fingertips: NDArray[np.float64]
    pressing: NDArray[np.bool_]
    x: NDArray[np.float64]

    __repr__ = short_repr


class KeystrokeTracker:
    """Follows plans that have strikes.

    Args:
        config: its settings; those of the zero-shot player if None.
        world: name of the world in which it moves hands.
    """

    def __init__(self, config: KeystrokeConfig | None = None, world: str = PAPER) -> None:
        self.config = config or KeystrokeConfig()
        self._hands = [Hand(side, world) for side in SIDES]

    def start(self, plan: FingertipPlan, begun: Continuation | None = None) -> KeystrokeController:
        """A controller with paths and the feed-forward controls that follow them.

        Args:
            plan: what to follow.
            begun: what it goes on from; None from rest, with no key struck.

        Raises:
            InputError: the plan has no strikes.
        """
        if plan.strikes is None:
            raise InputError("this plan has no strikes: it says nothing of notes between frames")
        return KeystrokeController(plan, plan.strikes, self.config, self._hands, begun)


class KeystrokeController:
    """Feed-forward controls of one plan, and feedback of the present errors.

    Attributes:
        plan: what is followed.
        strikes: of the plan.
        config: settings.
        corrections: of the strikes, as they were given last.
        speeds: (M,) speed of each key's front edge at which it is to sound [m/s].
        x: (M,) world x at which each key is struck [m].

    Args:
        plan: what is followed.
        strikes: of the plan.
        config: settings.
        hands: (left, right), for kinematics; their pose is not preserved.
        begun: what it goes on from; None from rest, with no key struck.
    """

    replayable = True

    def __init__(
        self,
        plan: FingertipPlan,
        strikes: Strikes,
        config: KeystrokeConfig,
        hands: list[Hand],
        begun: Continuation | None = None,
    ) -> None:
        self.plan, self.strikes, self.config = plan, strikes, config
        self.speeds = config.stroke.speeds(strikes)
        self._hands = hands
        rest = np.zeros((config.controls + 1, LAYOUT.hand_joints))
        self._begun = begun
        self._before = begun.poses if begun else [rest] * len(hands)
        ends = np.arange(1, len(plan) * config.controls + 1, dtype=np.float64)
        self._times = ends * self._dt
        self._gain = np.full(LAYOUT.hand_joints, config.joint_feedback)
        self._gain[LAYOUT.slides] = config.slide_feedback
        frame = np.floor(strikes.onset / FRAME_SECONDS).astype(int).clip(0, len(plan) - 1)
        self.x = plan.fingertips[frame, strikes.hand, 1 + strikes.finger, 0]
        if begun:
            self.x = np.where(np.isnan(begun.x), self.x, begun.x)
        hinge = key_centres()[strikes.key, 0] - key_half_sizes()[strikes.key, 0]
        self._reach = self.x - hinge
        # The last is of fingers that strike nothing, whose strike is -1.
        self._centre = np.append(key_centres()[strikes.key, 1], np.nan)
        self._strike_with(Corrections.none(len(strikes)))
        steps = Steps("paths", len(hands) * config.path.iterations * len(plan))
        self._paths = np.stack(self._coarse_paths(steps))
        if begun:
            for path, planned in zip(self._paths, begun.planned, strict=True):
                _begin_with(path[1:], planned)
        steps = Steps("controls", self._steps(config.refine))
        self._aim(config.refine, steps.advance)

    @property
    def world(self) -> str:
        """Name of the world in which it moves hands."""
        return self._hands[0].world

    @property
    def controls_per_frame(self) -> int:
        """Number of controls that follow one another in a frame."""
        return self.config.controls

    @property
    def correction_steps(self) -> int:
        """The steps of `correct`, as it counts them."""
        return self._steps(self.config.again)

    def paths_about(
        self, frame: int
    ) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
        """Poses before a later frame and those planned from it on, as in `Continuation`."""
        stop = frame * self.config.controls + 1
        before = [path[stop - self.config.controls - 1 : stop] for path in self._paths]
        return before, [path[stop:] for path in self._paths]

    def correct(self, corrections: Corrections, advance: Callable[[int], None] = ignore) -> None:
        """Aim at other times and speeds.

        Args:
            corrections: of the strikes.
            advance: called with a number of steps as they are done, `correction_steps` in all.
        """
        self._strike_with(corrections)
        self._aim(self.config.again, advance)

    def _steps(self, iterations: int) -> int:
        return len(self._hands) * (iterations + 2) * len(self._times)

    def _strike_with(self, corrections: Corrections) -> None:
        """Compute the strokes of corrected strikes."""
        self.corrections = corrections
        self._strokes = strokes_of(
            self.strikes, corrections, self._reach, self._times, self.config.stroke
        )

    def _aim(self, iterations: int, advance: Callable[[int], None]) -> None:
        """Compute paths of the strokes, in Gauss-Newton steps from those there are, and controls.

        Args:
            iterations: number of Gauss-Newton steps.
            advance: called with a number of steps as they are done.
        """
        count = len(self._times)
        self._feedforward = np.empty((count, LAYOUT.ctrl_size))
        self._press = np.zeros((count, 2, FINGER_COUNT, LAYOUT.hand_actuators))
        self._tips = np.empty((2, count + 1, FINGER_COUNT, 3))
        config = replace(self.config.path, iterations=iterations)
        # An idle finger counts for the time for which it is idle, a stroke for each of its points.
        share = 1.0 / np.sqrt(self.config.controls)
        problems = []
        for index in range(len(self._hands)):
            targets, weights = self._targets(index)
            weights *= share
            weights[:, 1:][self._strokes.tight[:, index]] /= share
            lately = self._before[index][[-2, -1]]
            problems.append(self._problem(index, targets, weights, config, lately, self._dt))
        self._paths = np.stack(smooth_paths(problems, advance, [path[1:] for path in self._paths]))
        for index, (hand, path) in enumerate(zip(self._hands, self._paths, strict=True)):
            self._follow(index, hand, path)
            advance(count)
            earlier = self._before[index][-2]
            torque = to_actuators(hand, motion_torque(hand, path, self._dt, earlier)) / hand.gain
            self._feedforward[:, hand.actuators] = (path[1:] + path[:-1]) / 2 @ hand.to_ctrl.T
            self._feedforward[:, hand.actuators] += torque
            advance(count)

    def control(self, frame: int, world: World) -> NDArray[np.float64]:
        """(46,) right then left: feed-forward, and a share of the present errors.

        A finger that is not over its key would press another one or be caught by it: it is lifted
        above the keys until it is over its key. So is an idle finger that has sunk between keys.

        Args:
            frame: number of the control, of which a frame has `controls_per_frame`.
            world: as it is before it.
        """
        config, qpos = self.config, world.qpos
        ctrl: NDArray[np.float64] = self._feedforward[frame].copy()
        here = np.stack([qpos[hand.joints] for hand in self._hands])
        found = [
            hand.points_and_jacobian(pose) for hand, pose in zip(self._hands, here, strict=True)
        ]
        tips = np.stack([points[1:] for points, _ in found])
        jacobian = np.stack([jacobian[1:] for _, jacobian in found])
        # A finger corrects itself, and only what striking fingers have in common is left to the
        # forearm: moving it moves all of them.
        jacobian[..., : LAYOUT.arm_joints] = 0.0
        error = self._tips[:, frame] - tips
        strike = self._strokes.strike[frame]
        strikes = strike >= 0
        arrives = self._tips[:, frame + 1, :, 1] - error[..., 1]
        beside = np.abs(arrives - self._centre[strike]) > config.astray
        low = tips[..., 2] < resting_height(tips[..., 0]) - config.sunk
        lift = np.where(strikes, beside, low)
        move = self._gain * (self._paths[:, frame] - here)
        reach = reach_joints(jacobian, error, config.tip_error, config.tip_damping)
        move += config.tip_feedback * reach
        along = error[..., 1].clip(-config.tip_error, config.tip_error)
        press = np.where((strikes & ~lift)[..., None], self._press[frame], 0.0).sum(axis=1)
        for index, hand in enumerate(self._hands):
            move[index, LAYOUT.slide] += shared(along[index, strikes[index]])
            if lift[index].any():
                move[index] += lift_joints(jacobian[index, lift[index], 2], config.clear)
            ctrl[hand.actuators] += hand.to_ctrl @ move[index] + press[index]
        return ctrl

    @property
    def _dt(self) -> float:
        """[s] Length of a control."""
        return FRAME_SECONDS / self.config.controls

    def _problem(
        self,
        index: int,
        targets: NDArray[np.float64],
        weights: NDArray[np.float64],
        config: PathConfig,
        before: NDArray[np.float64],
        dt: float,
    ) -> PathProblem:
        """What the path of one hand is to be, from two poses (2, 27) on that are `dt` apart."""
        clearance = np.full((len(targets), FINGER_COUNT), np.nan)
        return PathProblem(
            self._hands[index], before[1], targets, weights, clearance, config, dt, before[0]
        )

    def _coarse_paths(self, steps: Steps) -> list[NDArray[np.float64]]:
        """(n + 1, 27) for each hand, to begin with: those of frames, straight between them."""
        ends = slice(self.config.controls - 1, None, self.config.controls)
        problems = []
        for index in range(len(self._hands)):
            targets, weights = (array[ends] for array in self._targets(index))
            lately = self._before[index][[0, -1]]
            problems.append(
                self._problem(index, targets, weights, self.config.path, lately, FRAME_SECONDS)
            )
        at = np.arange(len(self.plan) + 1) * FRAME_SECONDS
        times = np.append(0.0, self._times)
        return [
            np.stack([np.interp(times, at, joint) for joint in path.T], axis=1)
            for path in smooth_paths(problems, steps.advance)
        ]

    def _targets(self, index: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Targets and weights (n, 6, 3) of one hand, as `smooth_path` takes them."""
        ends = np.arange(1, len(self.plan) + 1) * FRAME_SECONDS
        points = self.plan.fingertips[:, index]
        pressing = self.plan.finger_key[:, index] >= 0
        if self._begun:
            ends = np.append(0.0, ends)
            points = np.concatenate((self._begun.fingertips[None, index], points))
            pressing = np.concatenate((self._begun.pressing[None, index], pressing))
        targets = np.empty((len(self._times), POINT_COUNT, 3))
        for point, axis in np.ndindex(POINT_COUNT, 3):
            # The height of a finger that presses says nothing of where it hovers.
            known = ~pressing[:, point - 1] if point and axis == 2 else np.ones(len(ends), bool)
            if not known.any():
                known[:] = True
            targets[:, point, axis] = np.interp(
                self._times, ends[known], points[known, point, axis]
            )
        weights = np.zeros_like(targets)
        weights[:, 0, 1] = 1 / _WRIST_TOLERANCE
        weights[:, 1:] = 1 / _HOVER_TOLERANCE
        strike = self._strokes.strike[:, index]
        busy = strike >= 0
        key = self.strikes.key[strike[busy]]
        targets[:, 1:, 0][busy] = self.x[strike[busy]]
        targets[:, 1:, 1][busy] = key_centres()[key, 1]
        targets[:, 1:, 2][busy] = KEY_REST[key] + self._strokes.height[:, index][busy]
        weights[:, 1:][busy] = 1 / _PRESS_TOLERANCE
        return targets, weights

    def _follow(self, index: int, hand: Hand, path: NDArray[np.float64]) -> None:
        """Note where the fingertips of a path are, and what presses as hard as strokes are."""
        to_control = np.linalg.pinv(hand.to_ctrl) / hand.gain
        force = self._strokes.force[:, index]
        self._tips[index] = hand.points_along(path)[:, 1:]
        busy = np.flatnonzero(force.any(axis=1))
        _, jacobian = hand.points_and_jacobians(path[1:][busy])
        for step, down in zip(busy, jacobian[:, 1:, 2], strict=True):
            pushing = np.flatnonzero(force[step])
            push = -force[step, pushing, None] * down[pushing]
            self._press[step, index, pushing] = push @ to_control


def _begin_with(path: NDArray[np.float64], planned: NDArray[np.float64]) -> None:
    """Put what was planned at the beginning of a path (n, 27), in place, and fade over to it."""
    both = min(len(path), len(planned))
    # The last part was planned without knowing what comes next.
    share = np.clip(2.0 - 2.0 * np.arange(both) / max(both, 1), 0.0, 1.0)[:, None]
    path[:both] += share * (planned[:both] - path[:both])

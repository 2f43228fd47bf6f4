"""Fidelity of the world to that of the PianoMime paper, by recordings of the paper's experts.

Needs the reference data (PIANOMIME_SHARED names its folder). Measured are

- replay: F1 of the keys pressed when the recorded controls of a clip are replayed open loop from
  the rest pose. The original simulator reaches 0.91, the recordings 0.92.
- one step: error of the joint positions one control step after a recorded state. Positions were
  recorded to 1e-4 rad, velocities to 1/500 rad/s, and the velocities of the keys are unknown.
- base: share of the rows in which every recorded control is within 1.05 times 3 % of its actuator's
  range about the control of the IK tracker; residuals of the experts were limited to 3 %.
- ik: precision, recall and F1 of the IK tracker on the human fingertips of `Stan_1`; published are
  0.80, 0.68 and 0.69.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

import common
from pianomime.keyboard import KEYS
from pianomime.music import FrameMetrics, frame_metrics
from pianomime.plan import FingertipPlan
from pianomime.players import rollout
from pianomime.track import IkTracker
from pianomime.world import PhysicsWarning, World
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES
from pianomime.world.parameters import key_travel

_FREEDOM = 1.05 * 0.03
_LEFT, _RIGHT = slice(0, LAYOUT.hand_joints), slice(LAYOUT.hand_joints, 2 * LAYOUT.hand_joints)


@dataclass(frozen=True)
class Clip:
    """What was recorded of one expert; row t is the state before action t.

    Attributes:
        number: of the clip.
        qpos: (T, 142) all joint positions, in the order of a World [rad, m].
        qvel_hands: (T, 54) in the order of a World [rad/s, m/s].
        ctrl: (T, 46) [rad, m].
        fingertips: (T, 2, 6, 3) [m] the human's.
        goal: (T, 88) bool.
    """

    number: int
    qpos: NDArray[np.float64]
    qvel_hands: NDArray[np.float64]
    ctrl: NDArray[np.float64]
    fingertips: NDArray[np.float64]
    goal: NDArray[np.bool_]


@dataclass
class Outcome:
    """What one clip gave."""

    replay: FrameMetrics
    blow_ups: int
    one_step: NDArray[np.float64] = field(repr=False)
    near_base: NDArray[np.bool_] = field(repr=False)


def clips(shared: Path, every: int = 1) -> Iterator[Clip]:
    """Every so many of the recorded clips."""
    folder = shared / "data" / "pianomime"
    with np.load(folder / "experts.npz") as file:
        recorded = dict(file)
    with np.load(folder / "demonstrations.npz") as file:
        human = dict(file)
    ends = np.cumsum(recorded["length"])
    human_ends = dict(zip(human["clip_id"], np.cumsum(human["length"]), strict=True))
    for number, end, length in list(
        zip(recorded["clip_id"], ends, recorded["length"], strict=True)
    )[::every]:
        rows = slice(end - length, end)
        human_rows = slice(human_ends[number] - length, human_ends[number])
        keys = recorded["key_state_255"][rows] / 255.0 * key_travel()
        yield Clip(
            number=int(number),
            qpos=np.hstack([keys, world_order(recorded["qpos_1e4"][rows] / 1e4)]),
            qvel_hands=world_order(recorded["qvel_500"][rows] / 500.0),
            ctrl=recorded["ctrl_1e4"][rows] / 1e4,
            fingertips=human["fingertips"][human_rows].astype(float),
            goal=np.unpackbits(human["goal_packed"][human_rows], axis=1)[:, :KEYS].astype(bool),
        )


def world_order(recorded: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joints (T, 54) as recorded, left before right and forearm last, as a World has them."""
    hands = [np.roll(recorded[:, hand], 3, axis=1) for hand in (_RIGHT, _LEFT)]
    return np.hstack(hands)


def replay(clip: Clip) -> tuple[FrameMetrics, int]:
    """How well the recorded controls play open loop, and how often the physics broke."""
    world = World()
    pressed = np.empty_like(clip.goal)
    for frame, ctrl in enumerate(clip.ctrl):
        world.step(ctrl)
        pressed[frame] = world.pressed
    return frame_metrics(clip.goal, pressed), world.blow_ups


def one_step_errors(clip: Clip, every: int) -> NDArray[np.float64]:
    """(N, 54) [rad, m] distance of the hands' joints from the recorded ones, a step later."""
    world = World()
    errors = []
    for row in range(0, len(clip.ctrl) - 1, every):
        world.reset(clip.qpos[row])
        world.data.qvel[KEYS:] = clip.qvel_hands[row]
        world.step(clip.ctrl[row])
        errors.append(np.abs(world.qpos_hands - clip.qpos[row + 1, KEYS:]))
    return np.array(errors)


def near_base(clip: Clip, every: int) -> NDArray[np.bool_]:
    """(N,) whether all 46 controls lie where the experts were free to put them."""
    tracker = IkTracker()
    rows = slice(None, None, every)
    near = np.ones(len(clip.ctrl[rows]), bool)
    for index, side in enumerate(SIDES):
        hand = Hand(side)
        joints, ctrl = clip.qpos[rows, hand.joints], clip.ctrl[rows, hand.actuators]
        freedom = _FREEDOM * (hand.ctrl_high - hand.ctrl_low)
        for row, target in enumerate(clip.fingertips[rows, index]):
            base = hand.to_ctrl @ tracker.step(hand, joints[row], target)
            near[row] &= bool((np.abs(ctrl[row] - base) <= freedom).all())
    return near


def ik_alone(shared: Path) -> FrameMetrics:
    """How well the IK tracker alone follows the human fingertips of `Stan_1`."""
    with np.load(shared / "data" / "stan" / "reference.npz") as file:
        fingertips, finger_key, goal = (file[k] for k in ("fingertips", "finger_key", "goal"))
    none = np.empty(0, np.int8)
    plan = FingertipPlan(fingertips, finger_key, note_hand=none, note_finger=none)
    world = World()
    pressed = np.empty_like(goal)
    for step in rollout(IkTracker().start(plan), world, np.zeros(len(plan), bool)):
        pressed[step.frame] = world.pressed
    return frame_metrics(goal, pressed)


def measure(clip: Clip, every: int) -> Outcome:
    """Everything about one clip; predictions from every so many rows."""
    with warnings.catch_warnings():
        # They are counted.
        warnings.simplefilter("ignore", PhysicsWarning)
        played, blow_ups = replay(clip)
        return Outcome(played, blow_ups, one_step_errors(clip, every), near_base(clip, every))


def main() -> None:
    options = common.parser("fidelity", __doc__)
    options.add_argument("--every", type=int, default=1, help="take every so many clips")
    options.add_argument("--every-row", type=int, default=4, help="predict from so many rows")
    arguments = options.parse_args()
    shared = common.shared()
    facts = common.machine()
    common.show_machine(facts)
    outcomes: dict[int, Outcome] = {}
    with ProcessPoolExecutor(len(common.cores())) as pool:
        futures = {
            pool.submit(measure, clip, arguments.every_row): clip.number
            for clip in clips(shared, arguments.every)
        }
        for future in track(as_completed(futures), "clips", total=len(futures)):
            outcomes[futures[future]] = future.result()
    results = summary([outcomes[number] for number in sorted(outcomes)], ik_alone(shared))
    common.table(["what", "measured", "wanted"], results["rows"])
    results["clips"] = {
        number: {"f1": outcomes[number].replay.f1, "blow_ups": outcomes[number].blow_ups}
        for number in sorted(outcomes)
    }
    common.report(arguments.output, facts, results)


def summary(outcomes: list[Outcome], ik: FrameMetrics) -> dict[str, Any]:
    """All clips together."""
    error = np.concatenate([outcome.one_step.ravel() for outcome in outcomes])
    near = np.concatenate([outcome.near_base for outcome in outcomes])
    f1 = np.array([outcome.replay.f1 for outcome in outcomes])
    precision = float(np.mean([outcome.replay.precision for outcome in outcomes]))
    recall = float(np.mean([outcome.replay.recall for outcome in outcomes]))
    rows = [
        ["clips replayed", len(outcomes), ""],
        ["replay, mean F1", float(f1.mean()), ">= 0.90"],
        ["replay, mean precision", precision, ""],
        ["replay, mean recall", recall, ""],
        ["replay, worst F1", float(f1.min()), ""],
        ["replay, blow-ups", sum(outcome.blow_ups for outcome in outcomes), ""],
        ["one step, median joint error [rad, m]", float(np.median(error)), "<= 2e-4"],
        ["one step, 90 % below [rad, m]", float(np.percentile(error, 90)), ""],
        ["one step, 99 % below [rad, m]", float(np.percentile(error, 99)), ""],
        ["rows near the base controller", float(near.mean()), ">= 0.99"],
        ["IK alone, precision", ik.precision, "0.80 +- 0.03"],
        ["IK alone, recall", ik.recall, "0.68 +- 0.03"],
        ["IK alone, F1", ik.f1, "0.69 +- 0.03"],
    ]
    return {"rows": rows}


if __name__ == "__main__":
    main()

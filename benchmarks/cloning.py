"""How well low-level policies follow a human's fingertips, on validation songs.

    python benchmarks/cloning.py demonstrations.npz out/generalist/low-diff.onnx [LOW.onnx ...]

Plays the clips of the songs that training keeps for validation, with the human's fingertips made
feasible for the robot's hands: by each low-level policy, by its expert (the dynamic tracker), and
by inverse kinematics. The last two also play the fingertips as they were recorded.
"""

from __future__ import annotations

import multiprocessing
import statistics
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import common
from pianomime.learn.data.dataset import read_demonstrations, validation_demonstrations
from pianomime.plan.demonstration import Demonstration, DemonstrationPlanner
from pianomime.plan.hand_path import make_feasible
from pianomime.players.player import PlannedPlayer
from pianomime.policies.finger_assignment import flat_plan
from pianomime.policies.methods import load_policy_tracker
from pianomime.policies.sampler import Sampler
from pianomime.track import DynamicTracker, IkTracker, Tracker

_AS_RECORDED = "as recorded"


def score(demonstration: Demonstration, tracker: str) -> dict[str, float]:
    """The metrics of one clip."""
    name, _, kind = tracker.partition(", ")
    if kind != _AS_RECORDED:
        plan = make_feasible(demonstration.plan)
        if name != "dynamic":
            plan = flat_plan(plan)
        demonstration = replace(demonstration, plan=plan)
    player = PlannedPlayer(name, DemonstrationPlanner(demonstration), _tracker(name))
    performance = player.play(demonstration.score)
    return {**performance.metrics(), "realtime_factor": performance.realtime_factor}


def _tracker(name: str) -> Tracker:
    if name == "dynamic":
        return DynamicTracker()
    return IkTracker() if name == "ik" else load_policy_tracker(Path(name), Sampler(2))


def main() -> None:
    """Play and print."""
    options = common.parser("cloning", __doc__)
    options.add_argument("demonstrations", type=Path)
    options.add_argument("low", type=Path, nargs="*")
    options.add_argument("--jobs", type=int, default=len(common.cores()))
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    clips = validation_demonstrations(read_demonstrations(arguments.demonstrations))
    trackers = [*map(str, arguments.low)]
    for name in ("dynamic", "ik"):
        trackers += [name, f"{name}, {_AS_RECORDED}"]
    rows = []
    with ProcessPoolExecutor(arguments.jobs, multiprocessing.get_context("spawn")) as pool:
        for tracker in trackers:
            made = list(pool.map(partial(score, tracker=tracker), clips))
            names = ("f1", "precision", "recall", "realtime_factor")
            means = [statistics.mean(one[name] for one in made) for name in names]
            rows.append([Path(tracker).name, len(made), *(round(mean, 3) for mean in means)])
            print(rows[-1], flush=True)
    common.table(["tracker", "clips", "F1", "precision", "recall", "real time"], rows)
    common.report(arguments.output, facts, {"rows": rows})


if __name__ == "__main__":
    main()

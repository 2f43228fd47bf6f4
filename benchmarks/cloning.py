"""How well low levels follow a human's fingertips, on songs that they did not learn from.

    python benchmarks/cloning.py demonstrations.npz out/generalist/low-diff.onnx [LOW.onnx ...]

Plays the clips of the songs that training keeps to measure on, with the human's fingertips made
feasible for the robot's hands: by each low level, by its teacher (the dynamic tracker), and by
inverse kinematics. The last two also play the fingertips as they were.
"""

from __future__ import annotations

import multiprocessing
import statistics
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import common
from pianomime.learn.data.clips import held_out, read_human
from pianomime.plan.demonstration import Demonstration, DemonstrationPlanner
from pianomime.plan.hand_path import make_feasible
from pianomime.players.player import Player
from pianomime.policies.finger_assignment import flat_heights
from pianomime.policies.methods import load_policy_tracker
from pianomime.policies.sampler import Sampler
from pianomime.track import DynamicTracker, IkTracker, Tracker

_AS_THEY_WERE = "as they were"


def score(demonstration: Demonstration, follower: str) -> dict[str, float]:
    """The metrics of one clip."""
    name, _, kind = follower.partition(", ")
    if kind != _AS_THEY_WERE:
        plan = make_feasible(demonstration.plan)
        if name != "dynamic":
            plan = replace(plan, fingertips=flat_heights(plan.fingertips, plan.finger_key))
        demonstration = replace(demonstration, plan=plan)
    player = Player(name, DemonstrationPlanner(demonstration), _tracker(name))
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
    clips = held_out(read_human(arguments.demonstrations))
    followers = [*map(str, arguments.low)]
    for name in ("dynamic", "ik"):
        followers += [name, f"{name}, {_AS_THEY_WERE}"]
    rows = []
    with ProcessPoolExecutor(arguments.jobs, multiprocessing.get_context("spawn")) as pool:
        for follower in followers:
            made = list(pool.map(partial(score, follower=follower), clips))
            names = ("f1", "precision", "recall", "realtime_factor")
            means = [statistics.mean(one[name] for one in made) for name in names]
            rows.append([Path(follower).name, len(made), *(round(mean, 3) for mean in means)])
            print(rows[-1], flush=True)
    common.table(["follower", "clips", "F1", "precision", "recall", "real time"], rows)
    common.report(arguments.output, facts, {"rows": rows})


if __name__ == "__main__":
    main()

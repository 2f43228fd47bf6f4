"""What each stage of a generalist costs: its networks take the planner's place one by one.

    python benchmarks/stages.py SONG.mid ... [--method three-stage] [--seconds 30]

plays every song at effort 0 as `zero-shot-20hz` does, then with ever more networks. Of
`three-stage`: with the fingers that `fingering` says, along planned paths; with the fingertips that
`hand-motion` predicts, too; and whole. Of `two-stage-diff`: with the fingertips that `high-diff`
predicts, made feasible; whole; and whole, but with the fingertips followed as they are predicted.
All but the whole have the same tracker, inverse dynamics. Prints the mean precision, recall and F1.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import common
from pianomime import Score, excerpt, load_player
from pianomime.plan import FingertipPlan
from pianomime.plan.hand_path import hand_paths, make_feasible
from pianomime.players.builtin import ZERO_SHOT_20HZ
from pianomime.players.player import PlannedPlayer, Player
from pianomime.policies.methods import SAMPLERS, THREE_STAGE, load_stages, policy_path
from pianomime.policies.network_file import load_policy
from pianomime.policies.predicted_plan import predicted_plan
from pianomime.policies.three_stage.fingering import FingeringRollout
from pianomime.policies.three_stage.hand_motion import HandMotionRollout
from pianomime.songs.find import find_songs
from pianomime.track import DynamicTracker

METRICS = ("precision", "recall", "f1")


class NetworkPlanner:
    """Plans with the first stage, or with the first two.

    Args:
        motion: whether the second stage says where fingertips go; otherwise paths are planned.
    """

    def __init__(self, motion: bool) -> None:
        self._motion = motion

    def plan(self, score: Score) -> FingertipPlan:
        """One row for each frame of the score; nothing of its notes."""
        stages, roll = load_stages(), score.roll()
        fingering = FingeringRollout(roll, stages.fingering)
        if self._motion:
            motion = HandMotionRollout(fingering, stages.motion)
            rows = [motion.step() for _ in roll]
            points, keys = (np.array(column) for column in zip(*rows, strict=True))
        else:
            keys = np.array([fingering.step() for _ in roll])
            points = hand_paths(keys)
        nobody = np.full(len(score), -1, np.int8)
        return FingertipPlan(points, keys, nobody, nobody)


class PredictedPlanner:
    """Plans with the high-level policy of `two-stage-diff`."""

    def plan(self, score: Score) -> FingertipPlan:
        """As `Planner.plan`; where the robot's hands can be."""
        policy = load_policy(policy_path("high-diff"), SAMPLERS[0])
        return make_feasible(predicted_plan(score, policy))


TWO_STAGE = "two-stage-diff"
PLAYERS: dict[str, dict[str, Callable[[], Player]]] = {
    THREE_STAGE: {
        ZERO_SHOT_20HZ: partial(load_player, ZERO_SHOT_20HZ, 0),
        "fingers by the network": lambda: PlannedPlayer(
            "fingers", NetworkPlanner(False), DynamicTracker()
        ),
        "and fingertips": lambda: PlannedPlayer("tips", NetworkPlanner(True), DynamicTracker()),
        f"and controls: {THREE_STAGE}": partial(load_player, THREE_STAGE, 0),
    },
    TWO_STAGE: {
        ZERO_SHOT_20HZ: partial(load_player, ZERO_SHOT_20HZ, 0),
        "fingertips by the network": lambda: PlannedPlayer(
            "tips", PredictedPlanner(), DynamicTracker()
        ),
        f"and controls: {TWO_STAGE}": partial(load_player, TWO_STAGE, 0),
        "and fingertips as predicted": partial(
            load_player, TWO_STAGE, 0, planner={"feasible": False}
        ),
    },
}


def play(song: Path, method: str, seconds: float) -> list[list[float]]:
    """Metrics of a song, a row for each player."""
    score = excerpt(Score.from_midi(song), seconds=seconds)
    rows = []
    for make in PLAYERS[method].values():
        metrics = make().play(score).metrics()
        rows.append([metrics[name] for name in METRICS])
    return rows


def main() -> None:
    """Play, and print the table."""
    options = common.parser("stages", __doc__)
    options.add_argument("songs", nargs="+")
    options.add_argument("--method", choices=PLAYERS, default=THREE_STAGE)
    options.add_argument("--seconds", type=float, default=30.0)
    options.add_argument("--jobs", type=int, default=len(common.cores()))
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    songs = find_songs(arguments.songs)
    with ProcessPoolExecutor(arguments.jobs, get_context("spawn")) as pool:
        one = partial(play, method=arguments.method, seconds=arguments.seconds)
        found = list(pool.map(one, songs))
    rows = [
        [name, *(round(statistics.mean(each), 3) for each in zip(*mine, strict=True))]
        for name, mine in zip(PLAYERS[arguments.method], zip(*found, strict=True), strict=True)
    ]
    common.table(["player", *METRICS], rows)
    common.report(
        arguments.output,
        facts,
        {"method": arguments.method, "songs": [song.name for song in songs], "rows": rows},
    )


if __name__ == "__main__":
    main()

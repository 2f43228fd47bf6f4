"""Trajectory search: controls of one song, improved in simulation pass after pass.

Each pass plays the song from beginning to end as `PredictiveSamplingTracker` does: a little way
ahead in a copy of the world, with variations where keys go wrong. The first pass starts from the
base controller and each later one from the best controls so far, so that what is right stays. The
goal is all keys of the score, those that the plan leaves out for lack of a finger included.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.envs.batch import prior_tracker
from pianomime.learn.expert.config import TrajectorySearchConfig
from pianomime.learn.runs.log import RunLog
from pianomime.learn.runs.run import Evaluation, RunFolder
from pianomime.learn.runs.tell import Tell
from pianomime.plan.demonstration import DemonstrationPlanner
from pianomime.players.performance import Performance
from pianomime.players.player import Player
from pianomime.track import PredictiveSamplingConfig, PredictiveSamplingTracker, Tracker
from pianomime.track.replay import ReplayTracker


def search(run: RunFolder, threads: int, tell: Tell) -> None:
    """Search until the run's steps are spent; go on after the last pass that was finished.

    Args:
        run: its folder.
        threads: how many variations step at the same time; 0 for one on each core. It changes
            nothing but the time that it takes.
        tell: told how far it is.

    Raises:
        InputError: the checkpoint is damaged.
        OSError: a checkpoint cannot be written; the one before stays.
    """
    state = run.state()
    curve = run.curve()
    ctrl = None if state is None else state[0]["ctrl"]
    steps = run.steps_done
    with closing(RunLog(run.tensorboard, steps + 1)) as log:
        while steps < run.config.steps:
            tracker = _pass(run, ctrl, len(curve), threads)
            played = _play(run, tracker, steps, curve, tell)
            steps += tracker.steps + len(played)
            made = Evaluation(steps, **_scores(played))
            if made.f1 > max((one.f1 for one in curve), default=-1.0):
                ctrl = played.ctrl
                run.keep_best({"ctrl": ctrl}, made)
            assert ctrl is not None
            curve.append(made)
            run.checkpoint({"ctrl": ctrl}, {}, curve)
            log.add(steps, {f"song/{name}": figure for name, figure in _scores(played).items()})


def pass_config(
    settings: TrajectorySearchConfig, number: int, seed: int
) -> PredictiveSamplingConfig:
    """Settings of a pass: the usual variations, larger and smaller ones by turns."""
    usual = PredictiveSamplingConfig()
    size = settings.sizes[number % len(settings.sizes)]
    draws = np.random.SeedSequence([seed, number]).generate_state(1)
    return replace(
        usual,
        variations=settings.variations,
        rounds=settings.rounds,
        commit=settings.commit,
        ahead=settings.ahead,
        joint=usual.joint * size,
        wrist=usual.wrist * size,
        slide=usual.slide * size,
        seed=int(draws[0]),
    )


def _pass(
    run: RunFolder, ctrl: NDArray[np.float64] | None, number: int, threads: int
) -> PredictiveSamplingTracker:
    inner: Tracker = prior_tracker(run.config.env) if ctrl is None else ReplayTracker(ctrl)
    config = pass_config(run.config.search, number, run.config.seed)
    return PredictiveSamplingTracker(inner, config, run.song.score.roll(), threads)


def _play(
    run: RunFolder,
    tracker: PredictiveSamplingTracker,
    steps: int,
    curve: list[Evaluation],
    tell: Tell,
) -> Performance:
    best = max((one.f1 for one in curve), default=0.0)
    remark = f"pass {len(curve) + 1}, F1 {best:.3f}"
    player = Player("search", DemonstrationPlanner(run.song), tracker)

    def passed_on(stage: str, done: int, total: int) -> None:
        tell(min(steps + tracker.steps + done, run.config.steps), run.config.steps, remark)

    return player.play(run.song.score, passed_on)


def _scores(played: Performance) -> dict[str, float]:
    metrics = played.metrics()
    return {name: metrics[name] for name in ("precision", "recall", "f1")}

"""Trajectory search: controls of one song, improved in simulation pass after pass.

Each pass plays the song from beginning to end with predictive sampling: a few frames ahead in a
copy of the world, with variations where keys go wrong. The first pass starts from the base
controller and each later one from the best controls so far, so that what is right stays. The goal
is all keys of the score, including those that the plan leaves out for lack of a finger.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.envs.batch import base_tracker
from pianomime.learn.expert.config import TrajectorySearchConfig
from pianomime.learn.expert.expert_run import Evaluation, ExpertRun
from pianomime.learn.runs.log import RunLog
from pianomime.music import Score
from pianomime.players.performance import Performance
from pianomime.players.player import Player
from pianomime.progress import Progress
from pianomime.track import (
    PredictiveSamplingConfig,
    PredictiveSamplingTracker,
    ReplayTracker,
    Tracker,
)
from pianomime.track.sampling.predictive_sampling import PredictiveSamplingController


def search_trajectory(run: ExpertRun, threads: int, progress: Progress) -> None:
    """Search until the run's steps are spent; resume after the last pass that was finished.

    Args:
        run: its folder.
        threads: how many variations step at the same time; 0 for one on each core. It changes
            nothing but the time that it takes.
        progress: called with the control steps spent and those in all.

    Raises:
        InputError: the checkpoint is damaged.
        OSError: a checkpoint cannot be written; the one before stays.
    """
    state = run.state()
    curve = run.curve()
    ctrl = None if state is None else run.controls_among(state.arrays)
    steps = run.steps_done
    with closing(RunLog(run.tensorboard, steps + 1)) as log:
        while steps < run.config.total_steps:
            player = _PassPlayer(run, ctrl, len(curve), threads)
            played = _play(run, player, steps, curve, progress)
            steps += player.steps + len(played)
            made = Evaluation(steps, **_scores(played))
            if made.f1 > max((one.f1 for one in curve), default=-1.0):
                ctrl = played.ctrl[:, 0]
                run.keep_best({"ctrl": ctrl}, made)
            assert ctrl is not None
            curve.append(made)
            run.checkpoint({"ctrl": ctrl}, steps, curve)
            log.add(steps, {f"eval/{name}": value for name, value in _scores(played).items()})


def pass_config(
    settings: TrajectorySearchConfig, number: int, seed: int
) -> PredictiveSamplingConfig:
    """Settings of a pass.

    Args:
        settings: of the search.
        number: of the pass, from 0; the size of the variations depends on it.
        seed: of the run.
    """
    default = PredictiveSamplingConfig()
    size = settings.sizes[number % len(settings.sizes)]
    seeds = np.random.SeedSequence([seed, number]).generate_state(1)
    return replace(
        default,
        variations=settings.variations,
        rounds=settings.rounds,
        commit=settings.commit,
        ahead=settings.ahead,
        joint=default.joint * size,
        wrist=default.wrist * size,
        slide=default.slide * size,
        seed=int(seeds[0]),
    )


class _PassPlayer(Player):
    """Plays one pass over the song of a run, which it improves as it goes.

    Args:
        run: whose song to play.
        ctrl: (T, 46) controls to improve [rad, m]; those of the base controller if None.
        number: of the pass, from 0.
        threads: how many variations step at the same time; 0 for one on each core.
    """

    name = "search"

    def __init__(
        self, run: ExpertRun, ctrl: NDArray[np.float64] | None, number: int, threads: int
    ) -> None:
        inner: Tracker = base_tracker(run.config.env) if ctrl is None else ReplayTracker(ctrl)
        config = pass_config(run.config.search, number, run.config.seed)
        self.world = run.config.env.world
        self._tracker = PredictiveSamplingTracker(
            inner, config, run.demonstration.score.roll(), threads, self.world
        )
        self._plan = run.demonstration.plan
        self._controller: PredictiveSamplingController | None = None

    @property
    def steps(self) -> int:
        """Control steps that were simulated to look ahead so far."""
        return 0 if self._controller is None else self._controller.steps

    def start(self, score: Score) -> PredictiveSamplingController:
        """As `Player.start`; the score is that of the run."""
        self._controller = self._tracker.start(self._plan)
        return self._controller


def _play(
    run: ExpertRun,
    player: _PassPlayer,
    steps: int,
    curve: list[Evaluation],
    progress: Progress,
) -> Performance:
    best = max((one.f1 for one in curve), default=0.0)
    shown = f"pass {len(curve) + 1}, F1 {best:.3f}"

    def passed_on(phase: str, done: int, total: int, remark: str = "") -> None:
        spent = min(steps + player.steps + done, run.config.total_steps)
        progress("training", spent, run.config.total_steps, shown)

    return player.play(run.demonstration.score, passed_on)


def _scores(played: Performance) -> dict[str, float]:
    metrics = played.metrics()
    return {name: metrics[name] for name in ("precision", "recall", "f1")}

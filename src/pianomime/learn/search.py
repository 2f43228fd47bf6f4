"""The expert that is found by trying: a song's controls, improved in simulation pass after pass.

Each pass plays the song from beginning to end as `RolloutTracker` does: a little way ahead in a
copy of the world, with variations where keys go wrong. The first starts from the prior's controls
and each later one from the best so far, so that what is right stays. All keys of the score are
wanted, also those that the plan leaves out for lack of a finger.
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pianomime.learn.config import SearchConfig
from pianomime.learn.run_folder import Evaluation, RunFolder
from pianomime.learn.run_log import RunLog
from pianomime.learn.song_batch import prior_tracker
from pianomime.learn.stored_tracker import StoredTracker
from pianomime.learn.tell import Tell
from pianomime.performance import Performance
from pianomime.play import Player
from pianomime.track import RolloutConfig, RolloutTracker, Tracker
from pianomime.video.demonstration import DemonstrationPlanner


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


def pass_config(settings: SearchConfig, number: int, seed: int) -> RolloutConfig:
    """How a pass tries: by turns as `RolloutConfig` does, in larger and in smaller moves."""
    usual = RolloutConfig()
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
) -> RolloutTracker:
    inner: Tracker = prior_tracker(run.config.env) if ctrl is None else StoredTracker(ctrl)
    config = pass_config(run.config.search, number, run.config.seed)
    return RolloutTracker(inner, config, run.song.score.roll(), threads)


def _play(
    run: RunFolder, tracker: RolloutTracker, steps: int, curve: list[Evaluation], tell: Tell
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

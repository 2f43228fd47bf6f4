"""Experts: train one on a song, and play with it."""

from __future__ import annotations

from pathlib import Path

from pianomime.errors import InputError
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.learn.envs.reference import load_song
from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.runs.lock import run_lock
from pianomime.learn.runs.run import RunFolder
from pianomime.learn.runs.tell import Tell
from pianomime.learn.runs.validation import check_config
from pianomime.plan.demonstration import DemonstrationPlanner
from pianomime.players.player import Player
from pianomime.track import Tracker
from pianomime.track.replay import ReplayTracker


def train_expert(
    song: str | Path,
    out: Path,
    config: ExpertConfig,
    start: float = 0.0,
    seconds: float = EXCERPT_SECONDS,
    threads: int = 0,
    tell: Tell | None = None,
) -> RunFolder:
    """Train an expert of one song, or go on where a run of the same was.

    Args:
        song: a demonstration (.npz), a MIDI file or the name of a bundled song.
        out: folder of the run.
        config: how.
        start: where the excerpt begins [s].
        seconds: its length at most [s].
        threads: of the physics and of PPO's networks; 0 for one on each core. PPO's curves are
            the same only with the same number.
        tell: told how far it is.

    Returns:
        The run, with its best expert.

    Raises:
        InputError: the song, the config or what is in the folder cannot be used.
        OSError: the folder cannot be written; what was there before stays.
    """
    check_config(config)
    loaded = load_song(song, start, seconds)
    told = tell or (lambda done, total, remark: None)
    with run_lock(out):
        run = RunFolder.open(out, loaded, config, start, seconds)
        if run.finished:
            return run
        if config.method == "ppo":
            from pianomime.learn.expert.ppo import train_ppo

            train_ppo(run, threads, told)
        else:
            from pianomime.learn.expert.trajectory_search import search

            search(run, threads, told)
    return run


def load_expert(path: Path) -> tuple[Player, RunFolder]:
    """The best expert of a run, as a player, and the run.

    Raises:
        InputError: there is no run, nothing was trained in it, or it is damaged.
    """
    run = RunFolder.load(path)
    return Player("expert", DemonstrationPlanner(run.song), expert_tracker(run)), run


def expert_tracker(run: RunFolder) -> Tracker:
    """The tracker of the best expert of a run.

    Raises:
        InputError: nothing was trained yet, or the weights are damaged.
    """
    arrays, _ = run.best()
    if run.config.method == "ppo":
        from pianomime.learn.expert.residual_policy import ResidualPolicyTracker

        return ResidualPolicyTracker.from_arrays(run.song, run.config, arrays)
    if "ctrl" not in arrays or arrays["ctrl"].shape != (len(run.song.plan), 46):
        raise InputError(f"{run.path}: the expert's controls do not fit its song")
    return ReplayTracker(arrays["ctrl"])

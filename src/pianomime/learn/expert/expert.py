"""Experts: train one on a song, and play with it."""

from __future__ import annotations

from pathlib import Path

from pianomime.errors import InputError
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.learn.envs.reference import load_demonstration
from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.expert.expert_run import ExpertRun
from pianomime.plan.demonstration import DemonstrationPlanner
from pianomime.players.player import PlannedPlayer, Player
from pianomime.progress import Progress, no_progress
from pianomime.track import ReplayTracker, Tracker


def train_expert(
    song: str | Path,
    out: Path,
    config: ExpertConfig,
    start: float = 0.0,
    seconds: float = EXCERPT_SECONDS,
    threads: int = 0,
    progress: Progress = no_progress,
) -> ExpertRun:
    """Train an expert of one song, or resume a run of the same song and config.

    Args:
        song: a demonstration (.npz), a MIDI file or the name of a bundled song.
        out: folder of the run.
        config: how the expert is made.
        start: where the excerpt begins [s].
        seconds: its length at most [s].
        threads: of the physics and of PPO's networks; 0 for one on each core. PPO's curves are
            the same only with the same number.
        progress: called with the control steps spent and those in all.

    Returns:
        The run, with its best expert.

    Raises:
        InputError: the song, the config or what is in the folder cannot be used.
        OSError: the folder cannot be written; what was there before stays.
    """
    demonstration = load_demonstration(song, start, seconds)
    with ExpertRun.open(out, demonstration, config, start, seconds) as run:
        if run.finished:
            return run
        if config.method == "ppo":
            from pianomime.learn.expert.ppo import train_ppo

            train_ppo(run, threads, progress)
        else:
            from pianomime.learn.expert.trajectory_search import search_trajectory

            search_trajectory(run, threads, progress)
    return run


def load_expert(path: Path) -> tuple[Player, ExpertRun]:
    """The best expert of a run, as a player, and the run.

    Raises:
        InputError: there is no run, nothing was trained in it, or it is damaged.
    """
    run = ExpertRun.load(path)
    excerpt = run.start, run.seconds
    planner, tracker = DemonstrationPlanner(run.demonstration), expert_tracker(run)
    world = run.config.env.world
    return PlannedPlayer("expert", planner, tracker, excerpt=excerpt, world=world), run


def load_expert_player(effort: int, seed: int, run: str | Path = "") -> Player:
    """The player `expert`, for `pianomime.load_player`.

    Args:
        effort: of no meaning for an expert, which plays as it was trained to.
        seed: of no meaning either.
        run: folder of its run.

    Raises:
        InputError: as `load_expert`, or no folder is given.
    """
    if not run:
        raise InputError("an expert is loaded by the folder of its run (`pianomime train-expert`)")
    return load_expert(Path(run))[0]


def expert_tracker(run: ExpertRun) -> Tracker:
    """The tracker of the best expert of a run.

    Raises:
        InputError: nothing was trained yet, or the weights are damaged.
    """
    arrays, _ = run.best()
    if run.config.method == "ppo":
        from pianomime.learn.expert.residual_policy import ResidualPolicyTracker

        return ResidualPolicyTracker.from_arrays(run.demonstration, run.config, arrays)
    return ReplayTracker(run.controls_among(arrays))

"""Lessons: a demonstration is played, not always well, while a teacher says what it would do.

What experts leave behind shows only how all goes well: who imitates it does not learn what to do
when it does not. A teacher that can be asked at any moment, such as a tracker, is asked in the
moments that the pupil gets into (Ross et al., "A reduction of imitation learning and structured
prediction to no-regret online learning", 2011); noise on what is played brings on more of them.
"""

from __future__ import annotations

import multiprocessing
import os
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import replace

import numpy as np

from pianomime.errors import InputError
from pianomime.learn.data.dagger_config import DaggerConfig, check_dagger
from pianomime.learn.data.episode import Episode, empty_columns, fill_columns, write_state
from pianomime.plan.demonstration import Demonstration
from pianomime.plan.hand_path import make_feasible
from pianomime.policies.finger_assignment import flat_heights
from pianomime.policies.fingertip_policy import LearnedPlanner
from pianomime.policies.methods import load_policy_tracker
from pianomime.policies.policy import load_policy
from pianomime.policies.sampler import Sampler
from pianomime.track import DynamicTracker, IkTracker
from pianomime.world import World
from pianomime.world.hand import by_actuator

_QUICK = Sampler(steps=2)
"""How a pilot is asked: what it says need not be the best, and there are many frames."""

_REACH = by_actuator(1.0, 0.3, 0.03)
"""Noise [rad, m] of actuators that moves fingertips as 1 rad of a finger's does."""


def collect_dagger_episode(clip: Demonstration, number: int, config: DaggerConfig) -> Episode:
    """Play a demonstration and write down the teacher's controls as `action`.

    Its fingertips are first made feasible for the robot's hands (`make_feasible`): these are what
    high-level policies learn to output and low-level policies to reach. Fingertips of a high-level
    policy are recorded as it outputs them, and made feasible for the expert alone.

    Args:
        clip: what to play.
        number: of the clip, from which it is drawn, with the config's seed.
        config: how.

    Raises:
        InputError: the pilot cannot be read.
    """
    plan = clip.plan
    teacher, prior = DynamicTracker(), IkTracker()
    draw = np.random.default_rng([config.seed, number])
    spread = config.noise * draw.random() * _REACH
    seeds = draw.integers(2**31, size=2).tolist()
    pilot = teacher if config.pilot is None else load_policy_tracker(config.pilot, _QUICK, seeds[0])
    if config.planner is None:
        taught = make_feasible(plan)
        shown = replace(taught, fingertips=flat_heights(taught.fingertips, taught.finger_key))
    else:
        planner = LearnedPlanner(load_policy(config.planner, _QUICK), seeds[1])
        shown = planner.plan(clip.score)
        taught = make_feasible(shown)
    teacher.begin(taught)
    prior.begin(shown)
    if pilot is not teacher:
        pilot.begin(shown)
    added = np.zeros(46)
    goal, pedal = clip.score.roll(), clip.score.pedal_roll()
    columns = empty_columns(len(plan))
    world = World(quiet=True)
    for frame in range(len(plan)):
        write_state(columns, frame, world)
        columns["prior"][frame] = prior.control(frame, world)
        columns["action"][frame] = said = teacher.control(frame, world)
        played = said if pilot is teacher else pilot.control(frame, world)
        fresh = np.sqrt(1.0 - config.smooth**2) * draw.standard_normal(46)
        added = config.smooth * added + fresh
        world.step(played + spread * added, bool(pedal[frame]))
        columns["pressed"][frame] = world.pressed
    f1 = fill_columns(columns, goal, shown.fingertips, shown.finger_key)
    return Episode(clip.score.title, f1, "ik", columns, clip.song)


def collect_dagger(
    clips: Sequence[Demonstration], config: DaggerConfig, jobs: int | None = None
) -> Iterator[Episode]:
    """Lessons of many clips, in their order, several at a time.

    Args:
        clips: what to play.
        config: how.
        jobs: processes; one a core if None.

    Raises:
        InputError: the config, the pilot or the planner cannot be used.
    """
    check_dagger(config)
    if config.planner is not None and load_policy(config.planner).about["level"] != "high":
        raise InputError(f"{config.planner}: not a stage that says fingertips")
    if config.pilot is not None:
        load_policy_tracker(config.pilot)
    jobs = jobs or os.cpu_count() or 1
    if jobs == 1:
        for number, clip in enumerate(clips):
            yield collect_dagger_episode(clip, number, config)
        return
    # Not forked: MuJoCo and ONNX Runtime have threads.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        waiting: deque[Future[Episode]] = deque()
        try:
            for number, clip in enumerate(clips):
                waiting.append(pool.submit(collect_dagger_episode, clip, number, config))
                # Episodes are large: few are kept that nobody has taken.
                if len(waiting) > 2 * jobs:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

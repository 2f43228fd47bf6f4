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
from pianomime.generalist.methods import load_follower
from pianomime.generalist.policy import load_policy
from pianomime.generalist.sampler import Sampler
from pianomime.generalist.snap import flat_heights
from pianomime.generalist.wanting import LearnedPlanner
from pianomime.learn.episode import Episode, empty_columns, fill_columns, write_state
from pianomime.learn.lesson_config import LessonConfig, check_lessons
from pianomime.plan.hand_path import settled
from pianomime.track import DynamicTracker, IkTracker
from pianomime.video.demonstration import Demonstration
from pianomime.world import World
from pianomime.world.hand import by_actuator

_QUICK = Sampler(steps=2)
"""How a pilot is asked: what it says need not be the best, and there are many frames."""

_REACH = by_actuator(1.0, 0.3, 0.03)
"""Noise [rad, m] of actuators that moves fingertips as 1 rad of a finger's does."""


def hold_lesson(clip: Demonstration, number: int, config: LessonConfig) -> Episode:
    """Play a demonstration and write down the teacher's controls as `action`.

    Its fingertips are first settled as the robot's hands can have them (`settled`): these are what
    high levels learn to want, and low levels to reach. A high level's are shown as it says them,
    and settled for the teacher alone.

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
    pilot = teacher if config.pilot is None else load_follower(config.pilot, _QUICK, seeds[0])
    if config.planner is None:
        taught = settled(plan)
        shown = replace(taught, fingertips=flat_heights(taught.fingertips, taught.finger_key))
    else:
        planner = LearnedPlanner(load_policy(config.planner, _QUICK), seeds[1])
        shown = planner.plan(clip.score)
        taught = settled(shown)
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


def hold_lessons(
    clips: Sequence[Demonstration], config: LessonConfig, jobs: int | None = None
) -> Iterator[Episode]:
    """Lessons of many clips, in their order, several at a time.

    Args:
        clips: what to play.
        config: how.
        jobs: processes; one a core if None.

    Raises:
        InputError: the config, the pilot or the planner cannot be used.
    """
    check_lessons(config)
    if config.planner is not None and load_policy(config.planner).about["level"] != "high":
        raise InputError(f"{config.planner}: not a stage that says fingertips")
    if config.pilot is not None:
        load_follower(config.pilot)
    jobs = jobs or os.cpu_count() or 1
    if jobs == 1:
        for number, clip in enumerate(clips):
            yield hold_lesson(clip, number, config)
        return
    # Not forked: MuJoCo and ONNX Runtime have threads.
    with ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn")) as pool:
        waiting: deque[Future[Episode]] = deque()
        try:
            for number, clip in enumerate(clips):
                waiting.append(pool.submit(hold_lesson, clip, number, config))
                # Episodes are large: few are kept that nobody has taken.
                if len(waiting) > 2 * jobs:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

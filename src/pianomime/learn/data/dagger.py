"""DAgger: roll out a noisy policy, and label every visited state with the expert's action.

Trajectories of experts show only how everything goes well: a policy that imitates them does not
learn to recover. Here the expert is a tracker, which can be asked for its action in any state, so
it labels the states that the policy in training gets into (Ross, Gordon and Bagnell, "A reduction
of imitation learning and structured prediction to no-regret online learning", 2011). Noise on the
controls adds more such states (Laskey et al., "DART: noise injection for robust
imitation learning", 2017).
"""

from __future__ import annotations

import pickle
import warnings
from collections.abc import Generator, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np

from pianomime.errors import InputError, WorkFailed
from pianomime.keyboard import NO_KEY
from pianomime.learn.data.dagger_config import DaggerConfig
from pianomime.learn.data.episode import (
    Episode,
    base_controls,
    fill_columns,
    record,
    song_number,
)
from pianomime.learn.data.noisy_controller import NoisyController, noise_spread
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.plan.demonstration import Demonstration
from pianomime.plan.hand_path import make_feasible
from pianomime.policies.finger_assignment import flat_plan
from pianomime.policies.fingertip_policy import PlanRecord
from pianomime.policies.methods import load_policy_tracker
from pianomime.policies.network_file import load_policy
from pianomime.policies.policy_tracker import PolicyController
from pianomime.policies.predicted_plan import predicted_plan
from pianomime.policies.sampler import Sampler
from pianomime.staging import scratch
from pianomime.track import DynamicTracker, IkTracker
from pianomime.workers import Answer, Row, cores, work

_WORKER = "pianomime.learn.data.dagger:load_dagger_worker"

_FAST = Sampler(steps=2)
"""Sampling of the policies that play: there are many frames, and rough actions will do."""


def collect_dagger_episode(
    demonstration: Demonstration, number: int, config: DaggerConfig
) -> Episode:
    """Play a demonstration and record the expert's controls as `action`.

    The expert is the dynamic tracker. The fingertips, the demonstration's or those that a
    high-level policy predicts, are first made feasible for the robot's hands (`make_feasible`):
    these are what high levels learn to predict and low levels to reach. They are recorded with
    heights that tell alone which press (`flat_heights`).

    Args:
        demonstration: what to play.
        number: of the demonstration, which seeds its randomness together with the config's seed.
        config: which policies play, and the noise.

    Raises:
        InputError: a policy cannot be read, or the physics broke.
    """
    rng = np.random.default_rng([config.seed, number])
    spread = noise_spread(config.noise * rng.random())
    seeds = rng.integers(2**31, size=2).tolist()
    score = demonstration.score
    plan = demonstration.plan
    if config.fingertip_policy is not None:
        plan = predicted_plan(score, load_policy(config.fingertip_policy, _FAST), seeds[1])
    feasible = make_feasible(plan)
    plan = flat_plan(feasible)
    played = None
    if config.rollout_policy is not None:
        tracker = load_policy_tracker(config.rollout_policy, _FAST, seeds[0])
        played = PolicyController(plan, tracker, score.roll())
    expert = DynamicTracker().start(feasible)
    controller = NoisyController(expert, played, spread, config.noise_correlation, rng)
    columns, qpos, events = record(controller, score)
    columns["action"][:] = controller.labels
    base = base_controls(IkTracker().start(plan), qpos)
    f1 = fill_columns(columns, base, score.roll(), plan.fingertips, plan.finger_key)
    return Episode(score.title, f1, "ik", columns, demonstration.song_id, events=events)


def songs_without_plan(paths: Sequence[Path]) -> list[Demonstration]:
    """Songs whose fingertips a high-level policy is to predict; until then hands rest.

    Args:
        paths: of MIDI files, of which the first 30 s are taken; a warning tells of each that
            cannot be read, or holds no notes.

    Raises:
        InputError: that is so of all of them.
    """
    demonstrations = []
    for path in paths:
        try:
            whole = Score.from_midi(path)
            score = excerpt(whole)
        except InputError as error:
            warnings.warn(f"passed over: {error}", stacklevel=2)
            continue
        plan, song_id = PlanRecord(score).plan(), song_number(whole)
        demonstrations.append(Demonstration(score, plan, path.name, song_id=song_id))
    if not demonstrations:
        raise InputError("none of these songs can be played")
    return demonstrations


def check_policies(config: DaggerConfig) -> None:
    """Refuse policies that cannot play.

    Raises:
        InputError: one is not there, damaged, or of another level.
    """
    fingertips = config.fingertip_policy
    if fingertips is not None and load_policy(fingertips).info.level != "high":
        raise InputError(f"{fingertips}: not a policy that outputs fingertips")
    if config.rollout_policy is not None:
        load_policy_tracker(config.rollout_policy)


def collect_dagger(
    demonstrations: Sequence[Demonstration], config: DaggerConfig, jobs: int | None = None
) -> Generator[Episode, None, None]:
    """Episodes of many demonstrations, in their order, several at a time.

    One that cannot be played, as where the physics breaks, is left out, which a warning tells.
    Closing the generator ends the processes, also in the middle of work.

    Args:
        demonstrations: what to play.
        config: which policies play, and the noise.
        jobs: processes; one a core if None.

    Raises:
        InputError: a policy cannot be used, or no finger presses a key in a demonstration and no
            policy says where fingers go.
        WorkFailed: no demonstration can be played, or the disk for temporary files is full.
    """
    check_policies(config)
    if config.fingertip_policy is None:
        for demonstration in demonstrations:
            if (demonstration.plan.finger_key == NO_KEY).all():
                title = demonstration.score.title
                raise InputError(f"{title}: no finger presses a key; give a fingertip policy")
    # Episodes are large, and pass through files. Nobody else can write into this folder.
    with scratch() as folder:

        def request(number: int) -> dict[str, str]:
            names = {name: str(Path(folder, f"{number}.{name}")) for name in ("task", "episode")}
            task = demonstrations[number], number, config
            Path(names["task"]).write_bytes(pickle.dumps(task))
            return names

        # Whether each could be played.
        done: dict[int, bool] = {}
        turn = 0
        numbers = range(len(demonstrations))
        with closing(work(_WORKER, numbers, jobs or cores(), request=request)) as recorded:
            for number, row in recorded:
                if "unwritable" in row:
                    raise WorkFailed(f"episodes cannot be kept: {row['unwritable']}")
                done[number] = "error" not in row
                if not done[number]:
                    title = demonstrations[number].score.title
                    told = f"{title}: cannot be recorded: {row['error']}"
                    if len(done) == len(demonstrations) and not any(done.values()):
                        raise WorkFailed(told)
                    warnings.warn(f"left out: {told}", stacklevel=2)
                while turn in done:
                    if done[turn]:
                        path = Path(folder, f"{turn}.episode")
                        episode: Episode = pickle.loads(path.read_bytes())
                        path.unlink()
                        yield episode
                    turn += 1


def load_dagger_worker(setup: None) -> Answer:
    """What `collect_dagger` has its worker processes do, which needs no setup.

    Returns:
        What reads the arguments of `collect_dagger_episode` from the file `task` of a request,
        removes it, and writes the episode to the file `episode`. The row is empty, or has
        `unwritable`, the reason why the episode cannot be kept.
    """

    def record_episode(request: dict[str, str]) -> Row:
        task = Path(request["task"])
        episode = collect_dagger_episode(*pickle.loads(task.read_bytes()))
        task.unlink()
        try:
            Path(request["episode"]).write_bytes(pickle.dumps(episode))
        except OSError as error:
            # No fault of the demonstration: the next one could not be kept either.
            return {"unwritable": error.strerror or str(error)}
        return {}

    return record_episode

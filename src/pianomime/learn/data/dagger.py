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
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from pianomime.errors import InputError, WorkFailed
from pianomime.keyboard import NO_KEY
from pianomime.learn.data.dagger_config import DaggerConfig
from pianomime.learn.data.episode import (
    Episode,
    Recording,
    base_controls,
    fill_columns,
    record_together,
    song_number,
)
from pianomime.learn.data.noisy_controller import NoisyController, noise_spread
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.plan import FingertipPlan
from pianomime.plan.demonstration import Demonstration
from pianomime.plan.hand_path import make_feasible
from pianomime.policies.finger_assignment import flat_plan
from pianomime.policies.fingertip_policy import PlanRecord
from pianomime.policies.methods import load_policy_tracker
from pianomime.policies.network_file import load_policy
from pianomime.policies.policy import Policy
from pianomime.policies.policy_tracker import PolicyController, PolicyTracker
from pianomime.policies.predicted_plan import predicted_plan
from pianomime.policies.sampler import Sampler
from pianomime.shown import shown
from pianomime.staging import scratch
from pianomime.track import DynamicTracker, IkTracker
from pianomime.workers import Answer, Row, cores, work
from pianomime.world.device_batch import check_device, device_batch

_WORKER = "pianomime.learn.data.dagger:load_dagger_worker"

_FAST = Sampler(steps=2)
"""Sampling of the policies that play: there are many frames, and rough actions will do."""


class _Policies(NamedTuple):
    """The policies of a config, loaded once for all that is played side by side."""

    fingertips: Policy | None
    rollout: PolicyTracker | None

    @classmethod
    def of(cls, config: DaggerConfig) -> _Policies:
        """Load them.

        Raises:
            InputError: one is not there, damaged, or of another level.
        """
        fingertips = rollout = None
        if config.fingertip_policy is not None:
            fingertips = load_policy(config.fingertip_policy, _FAST)
            if fingertips.info.level != "high":
                raise InputError(f"{config.fingertip_policy}: not a policy that outputs fingertips")
        if config.rollout_policy is not None:
            rollout = load_policy_tracker(config.rollout_policy, _FAST)
        return cls(fingertips, rollout)


@dataclass(frozen=True, eq=False)
class _Take:
    """A demonstration that is ready to be played.

    Attributes:
        demonstration: what is played.
        plan: the fingertips that low levels are to reach, at heights that tell alone which press.
        controller: plays, and keeps what the expert would do.
    """

    demonstration: Demonstration
    plan: FingertipPlan
    controller: NoisyController


def collect_dagger_episodes(
    demonstrations: Sequence[Demonstration], numbers: Sequence[int], config: DaggerConfig
) -> list[Episode | InputError]:
    """Play demonstrations side by side, and record the expert's controls as `action`.

    The expert is the dynamic tracker. The fingertips, the demonstration's or those that a
    high-level policy predicts, are first made feasible for the robot's hands (`make_feasible`):
    these are what high levels learn to predict and low levels to reach. They are recorded with
    heights that tell alone which press (`flat_heights`).

    Args:
        demonstrations: what to play.
        numbers: of the demonstrations; each seeds its randomness together with the config's seed.
        config: which policies play, the noise, and what steps the worlds. On "cpu" an episode is
            the same bit for bit, whatever is played beside it.

    Returns:
        Of each demonstration its episode, or why there is none: it cannot be played, or the
        physics broke.

    Raises:
        InputError: a policy cannot be read, or the config's device cannot be used here.
    """
    policies = _Policies.of(config)
    made: list[Episode | InputError | None] = [None] * len(demonstrations)
    takes: dict[int, _Take] = {}
    for index, (demonstration, number) in enumerate(zip(demonstrations, numbers, strict=True)):
        try:
            takes[index] = _take(demonstration, number, config, policies)
        except InputError as error:
            made[index] = error
    if takes:
        controllers = [take.controller for take in takes.values()]
        scores = [take.demonstration.score for take in takes.values()]
        worlds = device_batch(len(takes), config.device, threads=1, quiet=True)
        recordings = record_together(controllers, scores, worlds)
        for index, recording in zip(takes, recordings, strict=True):
            if isinstance(recording, InputError):
                made[index] = recording
            else:
                made[index] = _episode(takes[index], recording)
    return [each for each in made if each is not None]


def _take(
    demonstration: Demonstration, number: int, config: DaggerConfig, policies: _Policies
) -> _Take:
    rng = np.random.default_rng([config.seed, number])
    spread = noise_spread(config.noise * rng.random())
    seeds = rng.integers(2**31, size=2).tolist()
    score, plan = demonstration.score, demonstration.plan
    if policies.fingertips is not None:
        plan = predicted_plan(score, policies.fingertips, seeds[1])
    feasible = make_feasible(plan)
    plan = flat_plan(feasible)
    played = None
    if policies.rollout is not None:
        played = PolicyController(plan, policies.rollout.seeded(seeds[0]), score.roll())
    expert = DynamicTracker().start(feasible)
    controller = NoisyController(expert, played, spread, config.noise_correlation, rng)
    return _Take(demonstration, plan, controller)


def _episode(take: _Take, recording: Recording) -> Episode:
    demonstration, plan = take.demonstration, take.plan
    score, columns = demonstration.score, recording.columns
    columns["action"][:] = take.controller.labels
    base = base_controls(IkTracker().start(plan), recording.qpos)
    f1 = fill_columns(columns, base, score.roll(), plan.fingertips, plan.finger_key)
    events = recording.events
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


def check_config(config: DaggerConfig) -> None:
    """Refuse policies that cannot play, and a device that cannot be used.

    Raises:
        InputError: a policy is not there, damaged, or of another level; or see `check_device`.
    """
    check_device(config.device)
    _Policies.of(config)


def collect_dagger(
    demonstrations: Sequence[Demonstration], config: DaggerConfig, jobs: int | None = None
) -> Generator[Episode, None, None]:
    """Episodes of many demonstrations, in their order, several at a time.

    One that cannot be played, as where the physics breaks, is left out, which a warning tells.
    Closing the generator ends the processes, also in the middle of work.

    Args:
        demonstrations: what to play.
        config: which policies play, the noise, and what steps the worlds.
        jobs: processes; one a core if None.

    Raises:
        InputError: a policy or the device cannot be used, or no finger presses a key in a
            demonstration and no policy says where fingers go.
        WorkFailed: no demonstration can be played, or the disk for temporary files is full.
    """
    check_config(config)
    if config.fingertip_policy is None:
        for demonstration in demonstrations:
            if (demonstration.plan.finger_key == NO_KEY).all():
                title = demonstration.score.title
                raise InputError(f"{title}: no finger presses a key; give a fingertip policy")
    jobs = cores() if jobs is None else jobs
    groups = _groups(len(demonstrations), config.worlds, jobs)
    # Episodes are large, and pass through files. Nobody else can write into this folder.
    with scratch() as folder:

        def request(group: range) -> dict[str, Any]:
            task = Path(folder, f"{group.start}.task")
            some = demonstrations[group.start : group.stop]
            task.write_bytes(pickle.dumps((some, list(group), config)))
            return {"task": str(task), "episodes": [str(_file(folder, each)) for each in group]}

        # Whether each could be played.
        done: dict[int, bool] = {}
        turn = 0
        with closing(_rows(groups, jobs, request)) as recorded:
            for group, row in recorded:
                if "unwritable" in row:
                    raise WorkFailed(f"episodes cannot be kept: {row['unwritable']}")
                reasons = row["errors"] if "errors" in row else [row["error"]]
                for number, reason in zip(group, reasons, strict=True):
                    done[number] = reason is None
                    if reason is not None:
                        title = demonstrations[number].score.title
                        told = f"{title}: cannot be recorded: {reason}"
                        if len(done) == len(demonstrations) and not any(done.values()):
                            raise WorkFailed(told)
                        warnings.warn(f"left out: {told}", stacklevel=2)
                while turn in done:
                    if done[turn]:
                        path = _file(folder, turn)
                        episode: Episode = pickle.loads(path.read_bytes())
                        path.unlink()
                        yield episode
                    turn += 1


def _groups(number: int, most: int, jobs: int) -> list[range]:
    """Demonstrations that are played side by side, by their numbers in order.

    Args:
        number: of all demonstrations.
        most: of those in a group.
        jobs: processes, none of which shall be idle while others have several to play.
    """
    size = max(min(most, -(-number // max(jobs, 1))), 1)
    return [range(first, min(first + size, number)) for first in range(0, number, size)]


def _rows(
    groups: list[range], jobs: int, request: Callable[[range], Any]
) -> Generator[tuple[range, Row], None, None]:
    """The rows of groups; one that fails as a whole is played again, one by one."""
    again: list[range] = []
    with closing(work(_WORKER, groups, jobs, request=request)) as recorded:
        for group, row in recorded:
            if "error" in row and len(group) > 1:
                again += [range(number, number + 1) for number in group]
            else:
                yield group, row
    if again:
        with closing(work(_WORKER, again, jobs, request=request)) as recorded:
            yield from recorded


def _file(folder: Path, number: int) -> Path:
    """Where the episode of a demonstration is handed over."""
    return folder / f"{number}.episode"


def load_dagger_worker(setup: None) -> Answer:
    """What `collect_dagger` has its worker processes do, which needs no setup.

    Returns:
        What reads the arguments of `collect_dagger_episodes` from the file `task` of a request,
        removes it, and writes each episode to its file in `episodes`. The row has `errors`: of
        each why there is none, or None. Or it has `unwritable`, the reason why an episode cannot
        be kept.
    """

    def record_episodes(request: dict[str, Any]) -> Row:
        task = Path(request["task"])
        made = collect_dagger_episodes(*pickle.loads(task.read_bytes()))
        task.unlink()
        try:
            for episode, path in zip(made, request["episodes"], strict=True):
                if isinstance(episode, Episode):
                    Path(path).write_bytes(pickle.dumps(episode))
        except OSError as error:
            # No fault of the demonstration: the next one could not be kept either.
            return {"unwritable": error.strerror or str(error)}
        errors = [shown(each) if isinstance(each, InputError) else None for each in made]
        return {"errors": errors}

    return record_episodes

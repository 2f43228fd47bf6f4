"""The environments: the libraries' checkers, observations, and that one and many are the same."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from numpy.typing import NDArray
from stable_baselines3.common.env_checker import check_env as sb3_check
from stable_baselines3.common.vec_env import VecCheckNan, VecMonitor

from pianomime.errors import InputError
from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.config import (
    EnvConfig,
    EpisodeConfig,
    ObservationConfig,
    preset_env,
)
from pianomime.learn.envs.observation import Observer, default_observation_terms
from pianomime.learn.envs.sb3_env import Sb3Env
from pianomime.learn.expert.config import preset_config
from pianomime.music import frame_metrics
from pianomime.plan.demonstration import Demonstration
from pianomime.track import DynamicTracker, IkTracker
from pianomime.world import World
from pianomime.world_names import WORLDS, WorldName

ENV = "pianomime.learn:pianomime/Song-v0"


def actions(steps: int, envs: int, size: int = 46, seed: int = 0) -> NDArray[np.float32]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (steps, envs, size)).astype(np.float32)


@pytest.mark.parametrize("preset", ["paper", "best"])
def test_both_checkers_pass(two_notes: Demonstration, preset: str) -> None:
    env = gymnasium.make(ENV, demonstration=two_notes, config=preset)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*Box observation space.*")
        # Pictures need OpenGL, and have a test of their own.
        gymnasium_check(env.unwrapped, skip_render_check=True)
        sb3_check(env.unwrapped)


def test_vector_forms_work_with_the_libraries_wrappers(two_notes: Demonstration) -> None:
    envs = RecordEpisodeStatistics(gymnasium.make_vec(ENV, num_envs=3, demonstration=two_notes))
    seen, _ = envs.reset(seed=1)
    assert envs.observation_space.contains(seen)
    frames = len(two_notes.plan)
    for frame, action in enumerate(actions(frames, 3)):
        seen, _, terminated, truncated, info = envs.step(action)
        assert envs.observation_space.contains(seen)
        assert terminated.all() == (frame == frames - 1)
        assert not truncated.any()
    assert (info["episode"]["l"] == frames).all()
    assert info["final_obs"][0].shape == seen[0].shape
    assert (info["frame"] == 0).all()

    vec = VecMonitor(VecCheckNan(Sb3Env(SongBatch(two_notes, EnvConfig(), 2))))
    assert vec.reset().shape == (2, 367)
    for action in actions(frames, 2):
        _, reward, done, infos = vec.step(action)
    assert done.all()
    assert reward.shape == (2,)
    assert infos[0]["episode"]["l"] == frames
    assert not infos[0]["TimeLimit.truncated"]


def test_many_are_each_what_one_is_bit_for_bit(
    two_notes: Demonstration, every_term: EnvConfig
) -> None:
    config = dataclasses.replace(every_term, episode=EpisodeConfig())
    many = SongBatch(two_notes, config, 3)
    many.reset(np.random.default_rng(0))
    alone = [gymnasium.make(ENV, demonstration=two_notes, config=config) for _ in range(3)]
    for row, env in enumerate(alone):
        seen, _ = env.reset(seed=0)
        assert (seen == many.observations[row]).all()
    for action in actions(len(two_notes.plan), 3):
        step = many.step(action)
        for row, env in enumerate(alone):
            seen, reward, terminated, _, info = env.step(action[row])
            assert (seen == many.observations[row]).all()
            assert reward == step.reward[row]
            assert terminated == step.terminated[row]
            assert info["f1"] == step.f1[row]


@pytest.mark.parametrize("world_name", WORLDS)
@pytest.mark.parametrize("base", ["ik", "dynamic"])
def test_no_residual_is_the_base_controller_alone(
    two_notes: Demonstration, base: str, world_name: WorldName
) -> None:
    config = EnvConfig(world=world_name, base=base)  # type: ignore[arg-type]
    batch = SongBatch(two_notes, config, 1)
    batch.reset(np.random.default_rng(0))
    world = World(world_name)
    tracker = IkTracker() if base == "ik" else DynamicTracker(world=world_name)
    controller = tracker.start(two_notes.plan)
    pressed = []
    for frame in range(len(two_notes.plan)):
        step = batch.step(np.zeros((1, 46)))
        world.step(controller.control(frame, world), False)
        pressed.append(world.pressed)
        assert (batch.state()["worlds"][0] == world.state()).all()
    assert step.f1[0] == pytest.approx(frame_metrics(two_notes.score.roll(), pressed).f1)


def test_residuals_are_a_share_of_the_ranges(two_notes: Demonstration) -> None:
    seen = ObservationConfig(base_control=True)
    batch = SongBatch(two_notes, EnvConfig(observation=seen), 2)
    batch.reset(np.random.default_rng(0))
    base = batch.observations[0, batch.observer.slices["base_control"]].astype(float)
    model = World().model
    low, high = model.actuator_ctrlrange.T
    action = np.vstack([np.ones(46), np.full(46, -7.0)])  # beyond -1 counts as -1
    batch.step(action)
    # MuJoCo's state ends with what was sent: it is asked of a World that is put there.
    world = World()
    sent = []
    for state in batch.state()["worlds"]:
        world.set_state(state)
        sent.append(world.data.ctrl.copy())
    proposed = (low + high) / 2 + base * (high - low) / 2
    np.testing.assert_allclose(sent[0], proposed + 0.03 * (high - low), atol=1e-6)
    np.testing.assert_allclose(sent[1], proposed - 0.03 * (high - low), atol=1e-6)


def test_observations_are_laid_out_as_documented(two_notes: Demonstration) -> None:
    config = ObservationConfig(goal=3, fingertips=2, errors=True, time=True)
    sizes = {term.name: term.size for term in default_observation_terms(config)}
    assert sizes == {
        "joints": 54,
        "velocities": 54,
        "keys": 88,
        "goal": 264,
        "fingertips": 72,
        "base_control": 46,
        "pedal": 1,
        "errors": 30,
        "time": 1,
    }
    assert list(sizes) == [field.name for field in dataclasses.fields(config)]
    batch = SongBatch(two_notes, EnvConfig(observation=config), 1)
    assert batch.observer.size == sum(sizes.values())
    batch.reset(np.random.default_rng(0))
    goal, pedal = two_notes.score.roll(), two_notes.score.pedal_roll()
    frames = len(goal)
    padded = np.vstack([goal, np.zeros((3, 88), bool)])
    for frame in range(frames + 1):
        seen = {name: batch.observations[0, where] for name, where in batch.observer.slices.items()}
        np.testing.assert_array_equal(seen["goal"].reshape(3, 88), padded[frame : frame + 3])
        assert seen["time"] == pytest.approx(frame / frames)
        if frame:
            assert seen["pedal"] == pedal[frame - 1]
        ahead = two_notes.plan.fingertips[np.minimum([frame, frame + 1], frames - 1)]
        targets = seen["fingertips"].reshape(2, 2, 6, 3) * [0.15, 0.6, 0.06] + [0.03, 0.0, 0.03]
        np.testing.assert_allclose(targets, ahead, atol=1e-6)
        if frame < frames:
            batch.step(np.zeros((1, 46)))


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(ObservationConfig)])
def test_every_term_can_be_switched_off(name: str) -> None:
    everything = ObservationConfig(errors=True, time=True)
    off: bool | int = 0 if name in ("goal", "fingertips") else False
    less = dataclasses.replace(everything, **{name: off})  # type: ignore[arg-type]
    whole, rest = (Observer(default_observation_terms(config)) for config in (everything, less))
    assert name not in [term.name for term in rest.terms]
    size = whole.slices[name].stop - whole.slices[name].start
    assert rest.size == whole.size - size


def test_cut_short_is_not_over(two_notes: Demonstration) -> None:
    frames = len(two_notes.plan)
    config = EnvConfig(episode=EpisodeConfig(frames=10))
    vec = Sb3Env(SongBatch(two_notes, config, 1))
    vec.reset()
    ends = []
    for number, action in enumerate(actions(frames, 1)):
        _, _, done, infos = vec.step(action)
        if done[0]:
            ends.append((number + 1, infos[0]["TimeLimit.truncated"]))
    assert ends == [(10, True), (20, True)]

    exact = SongBatch(two_notes, EnvConfig(episode=EpisodeConfig(frames=frames)), 1)
    exact.reset(np.random.default_rng(0))
    for action in actions(frames, 1):
        step = exact.step(action)
    assert step.terminated[0]
    assert not step.truncated[0]


def test_episodes_begin_anywhere_in_the_state_of_the_base_controller(
    two_notes: Demonstration,
) -> None:
    config = EnvConfig(episode=EpisodeConfig(start="anywhere"))
    batch = SongBatch(two_notes, config, 8)
    batch.reset(np.random.default_rng(3))
    began = batch.frames.copy()
    assert len(set(began.tolist())) > 3
    world, controller = World(), IkTracker().start(two_notes.plan)
    for frame in range(len(two_notes.plan)):
        for row in np.flatnonzero(began == frame):
            assert (batch.state()["worlds"][row] == world.state()).all()
        world.step(controller.control(frame, world))
    again = SongBatch(two_notes, config, 8)
    again.reset(np.random.default_rng(3))
    assert (again.observations == batch.observations).all()
    again.reset(np.random.default_rng(4))
    assert (again.frames != began).any()


def test_a_batch_goes_on_from_its_state_bit_for_bit(
    two_notes: Demonstration, every_term: EnvConfig
) -> None:
    one, other = SongBatch(two_notes, every_term, 2), SongBatch(two_notes, every_term, 2)
    one.reset(np.random.default_rng(0))
    one.frames[:] = 0
    one.step(actions(1, 2)[0])
    one.set_state(one.state())
    other.set_state(one.state())
    for action in actions(5, 2, seed=1):
        first, second = one.step(action), other.step(action)
        assert (one.observations == other.observations).all()
        assert (first.reward == second.reward).all()
        assert (first.truncated == second.truncated).all()


def test_the_policy_can_work_the_pedal(two_notes: Demonstration) -> None:
    config = dataclasses.replace(
        EnvConfig(),
        action=dataclasses.replace(EnvConfig().action, pedal=True),
        reward=dataclasses.replace(EnvConfig().reward, pedal=1.0),
    )
    batch = SongBatch(two_notes, config, 2)
    assert batch.action_size == 47
    batch.reset(np.random.default_rng(0))
    action = np.zeros((2, 47))
    action[:, 46] = 1.0, -1.0
    step = batch.step(action)
    assert not two_notes.score.pedal_roll()[0]
    assert step.reward[1] - step.reward[0] == pytest.approx(1.0)


def test_last_and_first_observations_are_kept_apart(two_notes: Demonstration) -> None:
    """The last observation of an episode is in infos, the first of the next in its place."""
    frames = len(two_notes.plan)
    config = EnvConfig(
        observation=ObservationConfig(time=True), episode=EpisodeConfig(frames=frames - 5)
    )
    alone = SongBatch(two_notes, config, 1)
    vec = Sb3Env(SongBatch(two_notes, config, 2))
    envs = gymnasium.make_vec(ENV, num_envs=2, demonstration=two_notes, config=config)
    alone.reset(np.random.default_rng(0))
    first = alone.observations[0].copy()
    vec.reset()
    envs.reset(seed=0)
    for action in actions(frames - 5, 1):
        step = alone.step(action)
        both = np.repeat(action, 2, axis=0)
        seen, _, done, infos = vec.step(both)
        shown, _, _, truncated, info = envs.step(both)
    last = alone.observations[0]
    assert last[-1] == pytest.approx((frames - 5) / frames)
    assert step.truncated[0]
    assert done.all()
    assert truncated.all()
    for row in range(2):
        np.testing.assert_array_equal(infos[row]["terminal_observation"], last)
        np.testing.assert_array_equal(info["final_obs"][row], last)
        np.testing.assert_array_equal(seen[row], first)
        np.testing.assert_array_equal(shown[row], first)
        assert infos[row]["f1"] == info["final_info"]["f1"][row] == step.f1[0]
    assert info["final_info"]["frame"].tolist() == [frames - 5] * 2
    assert info["frame"].tolist() == [0, 0]
    assert info["f1"].tolist() == [0.0, 0.0]


def test_stepping_past_the_end_is_refused(two_notes: Demonstration) -> None:
    batch = SongBatch(two_notes, EnvConfig(), 1)
    batch.reset(np.random.default_rng(0))
    for action in actions(len(two_notes.plan), 1):
        batch.step(action)
    with pytest.raises(ValueError, match="reset it first"):
        batch.step(np.zeros((1, 46)))


def test_poses_are_scaled_by_their_limits(two_notes: Demonstration) -> None:
    """Against a World and MuJoCo's own limits, joint by joint."""
    config = ObservationConfig(errors=True)
    batch = SongBatch(two_notes, EnvConfig(observation=config), 1)
    batch.reset(np.random.default_rng(0))
    world = World()
    for action in actions(8, 1):
        batch.step(action)
    world.set_state(batch.state()["worlds"][0])
    seen = {name: batch.observations[0, where] for name, where in batch.observer.slices.items()}
    low, high = world.model.jnt_range[88:].T
    # The right hand comes first, as in the model.
    assert world.model.joint(88).name.startswith("rh_")
    joints = (low + high) / 2 + seen["joints"] * (high - low) / 2
    np.testing.assert_allclose(joints, world.data.qpos[88:], atol=1e-5)
    assert np.abs(seen["joints"]).max() < 1.2
    np.testing.assert_allclose(seen["velocities"] * 10.0, world.data.qvel[88:], atol=1e-5)
    np.testing.assert_allclose(seen["keys"], world.key_state, atol=1e-6)
    assert world.key_state.any() or not seen["keys"].any()
    # Fingertips and their targets have the left hand first.
    away = two_notes.plan.fingertips[8, :, 1:] - world.fingertips[:, 1:]
    np.testing.assert_allclose(seen["errors"].reshape(2, 5, 3) * 0.05, away, atol=1e-6)


def test_a_start_in_the_middle_has_the_pedal_as_it_is(two_notes: Demonstration) -> None:
    config = EnvConfig(episode=EpisodeConfig(start="anywhere"))
    batch = SongBatch(two_notes, config, 64)
    batch.reset(np.random.default_rng(0))
    pedal = np.r_[False, two_notes.score.pedal_roll()]
    down = batch.observations[:, batch.observer.slices["pedal"]][:, 0]
    np.testing.assert_array_equal(down, pedal[batch.frames])
    assert 0 < down.sum() < len(down)


@pytest.mark.parametrize("preset", [preset_config, preset_env])
def test_presets_are_named_in_mistakes(preset: Callable[[str], object]) -> None:
    with pytest.raises(InputError, match="paper, best"):
        preset("worst")


@pytest.mark.parametrize("numbers", [{"num_envs": 0}, {"threads": -1}])
def test_numbers_of_environments_and_threads(
    shallow: Demonstration, numbers: dict[str, int]
) -> None:
    with pytest.raises(InputError, match="must be"):
        SongBatch(shallow, EnvConfig(), **numbers)

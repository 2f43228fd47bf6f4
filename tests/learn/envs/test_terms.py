"""Terms of the observation and of the reward: the defaults, and those that are added."""

from __future__ import annotations

import dataclasses

import gymnasium
import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.config import EnvConfig, ObservationConfig, RewardConfig
from pianomime.learn.envs.observation import ObservationTerm, default_observation_terms
from pianomime.learn.envs.reward import (
    RewardTerm,
    default_reward_terms,
    mimic_reward,
    press_reward,
)
from pianomime.learn.envs.sb3_env import Sb3Env
from pianomime.learn.envs.state import EnvState
from pianomime.plan.demonstration import Demonstration

ENV = "pianomime.learn:pianomime/Song-v0"


def effort(state: EnvState) -> NDArray[np.float64]:
    """Mean square of the action."""
    value: NDArray[np.float64] = (state.action**2).mean(axis=1)
    return value


def last_action(state: EnvState) -> NDArray[np.float64]:
    return state.action


EFFORT = RewardTerm("effort", effort, -0.5)
ACTION = ObservationTerm("last_action", last_action, 46)


def some_actions(steps: int, num_envs: int) -> NDArray[np.float64]:
    return np.random.default_rng(0).uniform(-1, 1, (steps, num_envs, 46))


def test_terms_can_be_added_from_outside(two_notes: Demonstration) -> None:
    env = gymnasium.make(
        ENV, demonstration=two_notes, extra_rewards=(EFFORT,), extra_observations=(ACTION,)
    )
    plain = gymnasium.make(ENV, demonstration=two_notes)
    assert env.observation_space.shape == (367 + 46,)
    seen, _ = env.reset(seed=0)
    usual, _ = plain.reset(seed=0)
    np.testing.assert_array_equal(seen[:367], usual)
    assert not seen[367:].any()
    for action in some_actions(6, 1)[:, 0]:
        seen, reward, _, _, info = env.step(action)
        usual, base, _, _, rest = plain.step(action)
        np.testing.assert_array_equal(seen[:367], usual)
        np.testing.assert_array_equal(seen[367:], action.astype(np.float32))
        assert info["reward/effort"] == pytest.approx(-0.5 * (action**2).mean())
        assert reward == base + info["reward/effort"]
        assert "reward/effort" not in rest


def test_vector_environments_take_them_as_well(two_notes: Demonstration) -> None:
    terms = {"extra_rewards": (EFFORT,), "extra_observations": (ACTION,)}
    envs = gymnasium.make_vec(ENV, num_envs=3, demonstration=two_notes, **terms)
    batch = SongBatch(
        two_notes,
        EnvConfig(),
        3,
        reward_terms=(*default_reward_terms(RewardConfig()), EFFORT),
        observation_terms=(*default_observation_terms(ObservationConfig()), ACTION),
    )
    vec = Sb3Env(batch)
    envs.reset(seed=0)
    vec.reset()
    for action in some_actions(len(two_notes.plan), 3):
        seen, reward, _, _, info = envs.step(action)
        same, also, done, infos = vec.step(action)
        np.testing.assert_array_equal(seen, same)
        np.testing.assert_array_equal(reward.astype(np.float32), also)
        total = info["reward/press"] + info["reward/mimic"] + info["reward/effort"]
        np.testing.assert_array_equal(total, reward)
        for name in ("press", "mimic", "effort"):
            values = [each[f"reward/{name}"] for each in infos]
            np.testing.assert_array_equal(values, info[f"reward/{name}"])
    assert done.all()
    np.testing.assert_array_equal(info["final_info"]["reward/press"], info["reward/press"])
    # The new episode has had no action yet.
    assert not seen[:, 367:].any()


def test_rewards_are_summed_in_the_order_of_the_paper(two_notes: Demonstration) -> None:
    """Bit for bit the weighted sum of press, mimic and pedal, from the batch's own state."""
    config = RewardConfig(press=0.6, mimic=0.3, pedal=0.1)
    states: list[EnvState] = []

    def recorded(state: EnvState) -> NDArray[np.float64]:
        states.append(state)
        return np.zeros(len(state))

    terms = (*default_reward_terms(config), RewardTerm("recorded", recorded))
    batch = SongBatch(two_notes, EnvConfig(reward=config), 2, reward_terms=terms)
    batch.reset(np.random.default_rng(0))
    for frame, action in enumerate(some_actions(8, 2)):
        step = batch.step(action)
        state = states[-1]
        assert (state.frames == frame).all()
        goal = two_notes.score.roll()[[frame, frame]]
        targets = two_notes.plan.fingertips[[frame, frame], :, 1:]
        np.testing.assert_array_equal(state.goal, goal)
        np.testing.assert_array_equal(state.targets, targets)
        np.testing.assert_array_equal(state.action, action)
        press = press_reward(batch.key_state, batch.pressed, goal, config.hit)
        mimic = mimic_reward(state.tips, targets)
        pedal = state.pedal == two_notes.score.pedal_roll()[frame]
        wanted = 0.6 * press + 0.3 * mimic + 0.1 * pedal
        np.testing.assert_array_equal(step.reward, wanted)
        np.testing.assert_array_equal(step.rewards["mimic"], 0.3 * mimic)


def test_terms_without_weight_are_left_out(two_notes: Demonstration) -> None:
    config = RewardConfig(press=0.0, mimic=0.0)
    batch = SongBatch(two_notes, EnvConfig(reward=config), 2)
    assert batch.reward_terms == ()
    batch.reset(np.random.default_rng(0))
    step = batch.step(some_actions(1, 2)[0])
    assert step.rewards == {}
    np.testing.assert_array_equal(step.reward, [0.0, 0.0])


def test_the_last_action_is_part_of_the_state(two_notes: Demonstration) -> None:
    terms = (*default_observation_terms(ObservationConfig()), ACTION)
    one, other = (SongBatch(two_notes, EnvConfig(), 2, observation_terms=terms) for _ in "ab")
    one.reset(np.random.default_rng(0))
    one.step(some_actions(1, 2)[0])
    other.set_state(one.state())
    assert (one.observations == other.observations).all()


def test_print_shows_the_table_of_terms(two_notes: Demonstration) -> None:
    env = gymnasium.make(
        ENV, demonstration=two_notes, extra_rewards=(EFFORT,), extra_observations=(ACTION,)
    )
    lines = [line.split() for line in str(env.unwrapped).splitlines()]
    assert ["observation:", "413", "numbers"] in lines
    for term in default_observation_terms(ObservationConfig()):
        shown = [term.name, str(term.size), *term.unit.split(), *term.scaling.split()]
        assert shown in lines
    assert ["last_action", "46", "none"] in lines
    for term, weight in (("press", "0.6667"), ("mimic", "0.3333"), ("effort", "-0.5")):
        assert [term, weight] in lines
    assert str(env.unwrapped.batch) in str(
        gymnasium.make_vec(
            ENV,
            num_envs=1,
            demonstration=two_notes,
            extra_rewards=(EFFORT,),
            extra_observations=(ACTION,),
        )
    )


def test_terms_that_do_not_fit_are_refused(two_notes: Demonstration) -> None:
    for extra in (
        {"extra_rewards": (RewardTerm("press", effort),)},
        {"extra_observations": (ObservationTerm("keys", last_action, 46),)},
    ):
        with pytest.raises(InputError, match="different names"):
            gymnasium.make(ENV, demonstration=two_notes, **extra)
    wrong = gymnasium.make(
        ENV, demonstration=two_notes, extra_rewards=(RewardTerm("whole", last_action),)
    )
    wrong.reset()
    with pytest.raises(ValueError, match=r"'whole' must have the shape \(1,\)"):
        wrong.step(np.zeros(46))
    wide = dataclasses.replace(ACTION, size=3)
    with pytest.raises(ValueError, match=r"'last_action' must have the shape \(1, 3\)"):
        gymnasium.make(ENV, demonstration=two_notes, extra_observations=(wide,)).reset()
    for make in (
        lambda: RewardTerm("", effort),
        lambda: RewardTerm("effort", effort, float("nan")),
        lambda: ObservationTerm("", last_action, 46),
        lambda: ObservationTerm("none", last_action, 0),
    ):
        with pytest.raises(InputError):
            make()
    with pytest.raises(InputError, match="at least one"):
        SongBatch(two_notes, EnvConfig(), observation_terms=())

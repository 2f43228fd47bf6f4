from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pianomime.learn.data.dataset import Dataset
from pianomime.learn.imitation.config import POLICIES, policy_config
from pianomime.learn.imitation.samples import Samples
from pianomime.policies.features import action_reference, octave_width, rest_points, to_world_frame
from pianomime.world.hand import Hand
from pianomime.world.model import SIDES


def samples_of(clips, name, **changes):
    return Samples.of(clips, replace(policy_config(name), tip_noise=0.0, **changes))


def absolute(made, sample):
    """The actions to learn, no longer relative to anything."""
    return sample["target"] + action_reference(
        made.config.level, made.config.residual, sample["vector"]
    )


def test_no_sample_crosses_a_clip(clips):
    made = samples_of(clips, "high-diff")
    sample = made.at(np.array([28, 36, 56]), np.zeros(3, int))
    goal = sample["goal"]
    np.testing.assert_array_equal(goal[0, :2], clips.columns["goal"][28:30])
    assert not goal[0, 2:].any()
    assert not goal[1:, 1:].any()
    tips = to_world_frame(absolute(made, sample).reshape(3, 4, 2, 6, 3))
    for row, last in enumerate((29, 36, 56)):
        np.testing.assert_allclose(tips[row, -1], clips.columns["fingertips"][last], atol=1e-6)


def test_a_clip_begins_at_rest(clips):
    made = samples_of(clips, "high-diff")
    for first in (0, 30, 37):
        np.testing.assert_allclose(made.points[first], rest_points(), atol=1e-6)
    np.testing.assert_array_equal(made.points[1], clips.columns["fingertips"][0])


@pytest.mark.parametrize("name", ["low-diff", "low-diff-res", "one-stage-diff", "bc-mse"])
def test_controls_are_those_of_the_clip(clips, name):
    made = samples_of(clips, name)
    rows = np.array([3, 40])
    sample = made.at(rows, np.zeros(2, int))
    ahead = rows[:, None] + np.arange(made.config.chunk)
    wanted = clips.columns["action"][ahead]
    if made.config.residual:
        wanted = wanted - clips.columns["base_control"][ahead]
    np.testing.assert_allclose(absolute(made, sample), wanted, atol=1e-6)


def test_an_octave_up_everything_is_an_octave_up(clips):
    made = samples_of(clips, "low-diff")
    rows = np.array([5, 45])
    here, up = (made.at(rows, np.full(2, by)) for by in (0, 1))
    np.testing.assert_array_equal(np.roll(here["goal"], 12, axis=-1), up["goal"])
    off = (up["frames"] - here["frames"]).reshape(2, 4, 2, 12, 3)
    # Targets move; how far they are from the fingertips stays.
    np.testing.assert_allclose(off[:, :, 0, :, 1], octave_width(), atol=1e-6)
    np.testing.assert_allclose(off[:, :, 1], 0, atol=1e-6)
    moved = absolute(made, up) - absolute(made, here)
    np.testing.assert_allclose(moved[..., [20, 43]], octave_width(), atol=1e-5)
    np.testing.assert_allclose(np.delete(moved, [20, 43], axis=-1), 0, atol=1e-5)
    # The points are those of the joints.
    joints, tips = up["vector"][:, :54], up["vector"][:, -36:].reshape(2, 2, 6, 3)
    for index, side in enumerate(SIDES):
        hand = Hand(side)
        first = hand.joints.start - 88
        for row in range(2):
            points = hand.points(joints[row, first : first + 27])
            np.testing.assert_allclose(points, tips[row, index], atol=1e-5)
    # What holds the pose moves with it: what is learned is the same.
    np.testing.assert_allclose(here["target"], up["target"], atol=1e-5)


def test_what_would_leave_the_keyboard_stays(clips):
    clips.columns["goal"][10, 5] = True
    made = samples_of(clips, "high-diff")
    sample = made.at(np.array([10]), np.array([-1]))
    assert sample["goal"][0, 0, 5]


@pytest.mark.parametrize("name", ["low-diff", "low-diff-res", "bc-mse"])
def test_beyond_a_clip_its_last_controls_are_held(clips, name):
    made = samples_of(clips, name)
    sample = made.at(np.array([28, 36]), np.zeros(2, int))
    goal = sample["goal"]
    np.testing.assert_array_equal(goal[0, :2], clips.columns["goal"][28:30])
    assert not goal[0, 2:].any()
    assert not goal[1, 1:].any()
    last = clips.columns["action"] - (
        clips.columns["base_control"] if made.config.residual else 0.0
    )
    target = absolute(made, sample)
    np.testing.assert_allclose(
        target[:, -1], last[[29, 36] if target.shape[1] > 1 else [28, 36]], atol=1e-6
    )
    if made.config.level == "low":
        targets = sample["frames"].reshape(2, 4, 2, 2, 6, 3)[:, -1, 0]
        np.testing.assert_allclose(targets, clips.columns["fingertips"][[29, 36]], atol=1e-6)


def test_what_forearms_cannot_reach_stays(clips):
    """A control that is at its end already."""
    clips.columns["action"][5, [20, 43]] = [0.6, 0.0]
    made = samples_of(clips, "low-diff")
    moved = made.at(np.array([5, 6]), np.ones(2, int))["goal"]
    still = made.at(np.array([5, 6]), np.zeros(2, int))["goal"]
    np.testing.assert_array_equal(moved[0], still[0])
    assert not np.array_equal(moved[1], still[1])


def test_base_controls_and_fingertips_move_by_an_octave_too(clips):
    rows = np.array([5, 45])
    made = samples_of(clips, "low-diff-res")
    here, up = (made.at(rows, np.full(2, by)) for by in (0, 1))
    np.testing.assert_allclose(here["target"], up["target"], atol=1e-5)
    base = (up["vector"] - here["vector"])[:, -46:]
    np.testing.assert_allclose(base[:, [20, 43]], octave_width(), atol=1e-5)
    np.testing.assert_allclose(np.delete(base, [20, 43], axis=1), 0, atol=1e-6)
    made = samples_of(clips, "high-diff")
    here, up = (
        to_world_frame(absolute(made, made.at(rows, np.full(2, by))).reshape(2, 4, 2, 6, 3))
        for by in (0, 1)
    )
    np.testing.assert_allclose(
        up - here, np.broadcast_to([0, octave_width(), 0], here.shape), atol=1e-5
    )


@pytest.mark.parametrize("name", POLICIES)
def test_the_same_seed_draws_the_same(clips, name):
    made = Samples.of(clips, policy_config(name))
    first, again, other = (made.draw(np.random.default_rng(seed), 8) for seed in (1, 1, 2))
    for name in first:
        np.testing.assert_array_equal(first[name], again[name])
    assert not np.array_equal(first["target"], other["target"])


def test_no_song_is_on_both_sides_of_the_split(clips):
    many = replace(clips, song_id=np.array([1, 1, 2]))
    learned, held = many.split()
    assert len(learned)
    assert len(held)
    assert not set(learned.song_id.tolist()) & set(held.song_id.tolist())
    assert len(learned) + len(held) == 3


def test_a_song_is_kept_whatever_else_there_is(clips):
    def kept(songs):
        many = Dataset(
            {"goal": np.zeros((len(songs), 88), bool)},
            np.arange(len(songs)) + 1,
            np.array(songs),
            ["a clip"] * len(songs),
        )
        return set(many.split()[1].song_id.tolist())

    every = kept(range(400))
    assert 15 < len(every) < 60
    assert kept(range(200)) == {song for song in every if song < 200}
    assert kept([*range(399, -1, -1), 3, 3]) == every


def test_noise_moves_the_targets_of_idle_fingertips_alone(clips):
    made = samples_of(clips, "low-diff", transpose=False, target_noise=0.0)
    noisy = samples_of(clips, "low-diff", transpose=False, target_noise=0.01)
    clips.columns["fingertips"][:, 0, 2, 2] = 0.0
    plain, moved = (one.draw(np.random.default_rng(0), 16)["frames"] for one in (made, noisy))
    off = (moved - plain).reshape(16, 4, 2, 2, 6, 3)
    np.testing.assert_allclose(off[..., 0, 2, :], 0, atol=1e-7)
    np.testing.assert_allclose(off[..., 2], 0, atol=1e-7)
    # The same in targets and tracking errors, and in every frame of a chunk.
    np.testing.assert_allclose(off[:, :, 0], off[:, :, 1], atol=1e-6)
    np.testing.assert_allclose(off, np.repeat(off[:, :1], 4, axis=1), atol=1e-6)
    assert off[..., 1, 3, 1].std() == pytest.approx(0.01, rel=0.6)

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import made_up_video as made_up
from pianomime import load_player
from pianomime.errors import InputError
from pianomime.plan import ZeroShotPlanner, make_feasible
from pianomime.plan.demonstration import Demonstration, DemonstrationPlanner, on_grid
from pianomime.players.player import PlannedPlayer
from pianomime.track import DynamicTracker


@pytest.fixture(scope="module")
def shown():
    score = on_grid(made_up.song(4.0))
    return Demonstration(score, ZeroShotPlanner().plan(score), "a.mp4", np.eye(3), {"notes": 3})


def test_comes_back_from_its_file(shown, tmp_path):
    path = tmp_path / "demo.npz"
    shown.save(path)
    again = Demonstration.load(path)
    for name in ("key", "onset", "offset", "velocity", "pedal", "title"):
        np.testing.assert_array_equal(getattr(again.score, name), getattr(shown.score, name))
    for name in ("fingertips", "finger_key", "note_hand", "note_finger"):
        np.testing.assert_array_equal(getattr(again.plan, name), getattr(shown.plan, name))
    np.testing.assert_array_equal(again.homography, shown.homography)
    assert (again.source, again.quality) == (shown.source, shown.quality)


def test_other_files_are_refused(shown, tmp_path):
    bad = tmp_path / "bad.npz"
    bad.write_bytes(b"PK nonsense")
    other = tmp_path / "other.npz"
    np.savez(other, demonstration_version=99)
    foreign = tmp_path / "foreign.npz"
    np.savez(foreign, a=1)
    for path in (bad, other, foreign):
        with pytest.raises(InputError) as caught:
            Demonstration.load(path)
        assert "\n" not in str(caught.value)
    with pytest.raises(FileNotFoundError):
        Demonstration.load(tmp_path / "nowhere.npz")


def test_damaged_files_are_refused(shown, tmp_path):
    path = tmp_path / "demo.npz"
    shown.save(path)
    whole = path.read_bytes()
    refused = 0
    for place in range(200, len(whole), max(1, len(whole) // 40)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 255]) + whole[place + 1 :])
        try:
            Demonstration.load(path)
        except InputError:
            refused += 1
    assert refused > 20


@settings(max_examples=40, deadline=None)
@given(start=st.floats(0, 3.2), seconds=st.floats(0.1, 5))
def test_excerpts_fit_their_roll(shown, start, seconds):
    part = shown.excerpt(start, seconds)
    assert len(part.plan) == part.score.frames()
    assert part.score.duration <= seconds + 0.05
    roll = part.score.roll()
    keys = part.plan.keys()
    # Nothing is pressed that is not due, and what the whole presses the part presses.
    assert not (keys & ~roll).any()
    first = round(part_start(shown, part) * 20)
    whole = shown.plan.keys()[first : first + len(keys)]
    inner = slice(0, len(keys) - 1)
    np.testing.assert_array_equal(keys[inner], whole[inner])
    assert len(part.plan.note_hand) == len(part.score)


def part_start(whole, part):
    """Where a part was cut out, found by its fingertips."""
    rows = whole.plan.fingertips
    for first in range(len(rows)):
        if np.array_equal(rows[first], part.plan.fingertips[0]):
            return first / 20
    raise AssertionError


def test_the_planner_knows_one_score(shown):
    planner = DemonstrationPlanner(shown)
    assert planner.plan(shown.score) is shown.plan
    with pytest.raises(InputError, match="not the score"):
        planner.plan(shown.score.transpose(1))


@pytest.mark.parametrize("name", ["demonstration", "demonstration-ik"])
def test_players_play_it(shown, name):
    performance = load_player(name, demonstration=shown).play(shown.score)
    assert performance.player == name
    np.testing.assert_array_equal(performance.plan.finger_key, shown.plan.finger_key)
    assert performance.metrics()["f1"] > 0.4


@pytest.fixture(scope="module")
def human(shown):
    """The demonstration with the fingertips of larger hands than the robot's, badly seen."""
    tips = shown.plan.fingertips.copy()
    tips[..., 0] -= 0.03
    tips += np.random.default_rng(0).normal(0, 0.003, tips.shape) * [1, 1, 0]
    return replace(shown, plan=replace(shown.plan, fingertips=tips))


def test_a_human_is_played_with_fingertips_where_the_robots_can_be(human):
    performance = load_player("demonstration", 0, demonstration=human).play(human.score)
    feasible = make_feasible(human.plan)
    np.testing.assert_array_equal(performance.plan.fingertips, feasible.fingertips)
    planner = DemonstrationPlanner(human)
    anchor = PlannedPlayer("demonstration", planner, DynamicTracker()).play(human.score)
    assert performance.metrics()["f1"] > anchor.metrics()["f1"] + 0.05


def test_a_human_is_played_as_recorded_where_that_is_set(human):
    anchored = {"planner.feasible": "false"}  # as from a command line
    made = load_player("demonstration", 0, demonstration=human, **anchored).play(human.score)
    assert made.plan is human.plan
    planner = DemonstrationPlanner(human)
    anchor = PlannedPlayer("demonstration", planner, DynamicTracker()).play(human.score)
    np.testing.assert_array_equal(made.ctrl, anchor.ctrl)
    published = load_player("demonstration-ik", demonstration=human).play(human.score)
    assert published.plan is human.plan


def test_players_of_demonstrations_do_not_play_midi():
    with pytest.raises(InputError, match="demonstrations"):
        load_player("demonstration")

"""The receding-horizon player: as good as one that plans the whole piece, long before it could."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pianomime import Performance, Score, load_player, songs
from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE
from pianomime.music import excerpt
from pianomime.players import PlannedPlayer
from pianomime.players.receding_horizon import (
    HorizonConfig,
    RecedingHorizonController,
    RecedingHorizonPlayer,
)
from pianomime.track.keystroke import KeystrokeController, KeystrokeTracker
from pianomime.world import World
from pianomime.world.parameters import key_centres

SHORT = HorizonConfig(first=1.0, longest=2.0, ahead=2.0)


def player(horizon: HorizonConfig) -> RecedingHorizonPlayer:
    found = load_player("zero-shot", effort=0)
    assert isinstance(found, RecedingHorizonPlayer)
    return replace(found, horizon=horizon)


def whole(of: RecedingHorizonPlayer) -> PlannedPlayer:
    """The same planner and tracker, one after the other."""
    return PlannedPlayer(of.name, of.planner, of.tracker, touch=of.touch)


def song(seconds: float = 6.0) -> Score:
    return excerpt(Score.from_midi(songs.path("bach-prelude-c")), 0.0, seconds, 0.5)


def test_one_stretch_is_the_whole_plan_bit_for_bit() -> None:
    score = song(3.0)
    ours = player(HorizonConfig(first=10.0))
    once, one_after_the_other = ours.play(score), whole(ours).play(score)
    np.testing.assert_array_equal(once.ctrl, one_after_the_other.ctrl)
    np.testing.assert_array_equal(once.qpos, one_after_the_other.qpos)
    assert once.plan is not None
    assert one_after_the_other.plan is not None
    np.testing.assert_array_equal(once.plan.fingertips, one_after_the_other.plan.fingertips)


def test_stretches_are_near_the_whole_plan_and_play_the_same_notes() -> None:
    score = song()
    ours = player(SHORT)
    by_stretches, at_once = ours.play(score), whole(ours).play(score)
    assert by_stretches.plan is not None
    assert at_once.plan is not None
    away = np.abs(by_stretches.plan.fingertips - at_once.plan.fingertips)
    assert np.median(away) < 1e-4
    assert len(by_stretches.event_key) == len(at_once.event_key)
    np.testing.assert_array_equal(by_stretches.event_key, at_once.event_key)
    assert np.abs(by_stretches.event_on - at_once.event_on).max() < 0.02


def test_the_hands_move_on_from_where_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Law: a stretch begins with the pose and the velocity with which the one before ended."""
    begun: list[Any] = []
    start = KeystrokeTracker.start

    def noting(self: KeystrokeTracker, plan: Any, given: Any = None) -> KeystrokeController:
        made = start(self, plan, given)
        begun.append((given and given.poses, made))
        return made

    monkeypatch.setattr(KeystrokeTracker, "start", noting)
    player(SHORT).play(song(4.0))
    assert len(begun) > 2
    for (_, one), (before, other) in itertools.pairwise(begun):
        assert before is not None
        for hand in range(2):
            path = other._paths[hand]
            np.testing.assert_array_equal(path[0], before[hand][-1])
            across = np.vstack([before[hand], path[1:6]])
            inside = np.abs(np.diff(one._paths[hand], n=2, axis=0)).max()
            at_the_seam = np.abs(np.diff(across, n=2, axis=0)).max()
            assert at_the_seam <= inside


def test_controls_do_not_jump_where_stretches_meet() -> None:
    score = excerpt(Score.from_midi(songs.path("c-major-study")), 0.0, 6.0, 0.5)
    ours = player(HorizonConfig(first=4.0))
    at_once, by_stretches = whole(ours).play(score), ours.play(score)
    meet = round(4.0 * FRAME_RATE)

    def step(played: Performance) -> float:
        """How far the controls move from the last one of a stretch to the next one."""
        before, after = played.ctrl[meet - 1, -1], played.ctrl[meet, 0]
        return float(np.abs(after - before).max())

    # By targets that jump to those of the next frame it is 8 times as far.
    assert step(by_stretches) < 2 * step(at_once)


@pytest.mark.parametrize("edge", range(9, 26, 2))
def test_strikes_at_the_end_of_a_stretch_are_where_the_whole_plan_has_them(edge: int) -> None:
    """Also where a finger strikes another key just as it has let one go."""
    random = np.random.default_rng(edge)
    onset = np.arange(24) * 0.1
    score = Score(random.integers(40, 64, 24), onset, onset + 0.1, np.full(24, 80))
    ours = player(HorizonConfig(first=edge / 20, longest=edge / 20, ahead=2.0))
    controller, world = ours.start(score), World()
    at_once = whole(ours).start(score)
    assert isinstance(at_once, KeystrokeController)
    for number in range(score.frames() * 5):
        controller.control(number, world)
    assert np.abs(controller._x - at_once.x).max() < 0.003


def test_pedal_and_world_are_those_of_the_score_and_player() -> None:
    score = song(3.0)
    score = replace(score, pedal=np.array([[0.4, 2.2]]))
    ours = load_player("zero-shot", effort=0, world="solid", horizon={"first": 1.0})
    played = ours.play(score)
    assert played.world == "solid"
    np.testing.assert_array_equal(played.pedal_times, score.pedal)
    assert len(played.event_key) >= len(score) - 1


def test_a_held_key_is_held_through_the_end_of_a_stretch() -> None:
    score = Score([40, 44], [0.6, 0.6], [6.6, 6.6], [80, 80])
    played = player(SHORT).play(score)
    assert sorted(played.event_key.tolist()) == [40, 44]
    assert (played.event_off > 6.5).all()


def test_a_leap_after_a_stretch_is_prepared_before_it() -> None:
    """What lies ahead counts: without it the hand would begin to move when it should be there."""
    # The left hand is busy in the bass, so the right one leaps.
    key, onset, offset = [5, 50, 87], [0.6, 0.6, 2.36], [3.0, 1.2, 2.8]
    score = Score(key, onset, offset, [80, 80, 80])
    horizon = replace(SHORT, first=2.0)
    looks, blind = (
        player(replace(horizon, ahead=ahead)).play(score) for ahead in (horizon.ahead, 0.0)
    )
    assert sorted(looks.event_key.tolist()) == [5, 50, 87]
    away = [
        abs(float(np.mean(played.plan.fingertips[39, 1, 1:, 1])) - key_centres()[87, 1])
        for played in (looks, blind)
        if played.plan is not None
    ]
    assert away[0] < 0.6 * away[1]


def test_the_plan_grows_while_it_is_played() -> None:
    score = song()
    controller = player(SHORT).start(score)
    world = World()
    known = []
    for frame in range(score.frames()):
        for part in range(controller.controls_per_frame):
            number = frame * controller.controls_per_frame + part
            world.step(controller.control(number, world), parts=controller.controls_per_frame)
        moves = np.abs(np.diff(controller.plan.fingertips, axis=0)).max(axis=(1, 2, 3)) > 0
        known.append(int(np.flatnonzero(moves)[-1]) + 2)
    # In the frame after those that are known, the hands would jump to rest.
    seen = round((SHORT.first + SHORT.ahead) * FRAME_RATE)
    assert known[0] == seen + 1 < score.frames()
    assert known == sorted(known)
    assert known[-1] == score.frames()
    assert (controller.plan.note_hand >= 0).all()


def test_it_must_be_asked_in_order() -> None:
    controller = player(SHORT).start(song(2.0))
    assert isinstance(controller, RecedingHorizonController)
    assert not controller.replayable


@pytest.mark.parametrize("notes", [0, 1])
def test_nearly_nothing_to_play(notes: int) -> None:
    score = Score([40] * notes, [0.01] * notes, [0.02] * notes, [64] * notes)
    assert len(player(SHORT).play(score)) == score.frames()


def test_it_plays_the_same_each_time() -> None:
    one, other = (player(SHORT).play(song(3.0)) for _ in range(2))
    np.testing.assert_array_equal(one.qpos, other.qpos)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"first": 0.0}, "first"),
        ({"longest": 1.0}, "longest"),
        ({"ahead": -1.0}, "ahead"),
        ({"ahead": np.nan}, "ahead"),
    ],
)
def test_what_cannot_be(settings: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        HorizonConfig(**settings)

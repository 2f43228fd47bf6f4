"""Confidence is high for what was played, and falls with all that shows in a wrong result."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import made_up_video as made_up
from pianomime.keyboard import BLACK
from pianomime.music import Score
from pianomime.plan import LEFT, RIGHT
from pianomime.video.align import align, raised
from pianomime.video.confidence import Confidence, estimate_confidence
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.keyboard_look import KeyboardLook, look_at_keyboard
from pianomime.video.notes.fingers import find_note_fingers
from pianomime.video.remarks import SOUND, Remark, on_agreement, on_keyboard, on_lost_hands
from pianomime.video.repairs import list_repairs
from pianomime.video.verdict import judge

SECONDS = 16.0
GONE = slice(160, 220)
"""Frames in which something is wrong."""


@pytest.fixture(scope="module")
def score():
    return wandering(0)


@pytest.fixture(scope="module")
def points(score):
    return made_up.plan_of(score).fingertips[..., :2].astype(np.float32)


def wandering(seed):
    """Music whose hands wander along the keyboard, unlike that of another seed."""
    draw = np.random.default_rng(seed)
    onset = np.arange(0.5, SECONDS - 0.6, 0.25)
    places = [
        np.clip(low + np.cumsum(draw.integers(-4, 5, len(onset))), low - 14, low + 14)
        for low in (26, 58)
    ]
    key = np.concatenate(places)
    begin = np.concatenate((onset, onset))
    return Score(key, begin, begin + 0.2, np.full(len(key), 80))


def seen(points, found=None):
    shape = points.shape
    found = np.ones(shape[:2], bool) if found is None else found
    return HandTracks(points, found, np.zeros(shape[:3], bool), 0, 0)


def usual(frames):
    return KeyboardLook(0.9, np.ones(frames, np.float32))


def confidence(tracks, score, look=None, certainty=1.0, missing=None) -> Confidence:
    tips = raised(tracks.points, score.frames())
    fingers = find_note_fingers(score, tips, tracks.seen)
    points = tips[: len(tracks), ..., :2]
    look = look or usual(len(tracks))
    missing = np.zeros(len(tracks), bool) if missing is None else missing
    return estimate_confidence(tracks, score, fingers, points, look, missing, certainty)


def later(score, seconds):
    return replace(score, onset=score.onset + seconds, offset=score.offset + seconds)


def test_a_good_one(score, points):
    made = confidence(seen(points), score)
    assert made.frames.min() > 0.8
    assert made.frames.mean() > 0.9
    assert made.better is None
    assert made.tempo is None
    assert judge(made, []).grade == "good"
    assert len(made.by_second()) == np.ceil(len(points) / 20)
    assert made.by_second() == pytest.approx(made.frames[:-1].mean(), abs=0.2)


@pytest.mark.parametrize("gone", [[LEFT], [RIGHT], [LEFT, RIGHT]])
def test_hands_that_are_lost(score, points, gone):
    found = np.ones(points.shape[:2], bool)
    found[GONE, gone] = False
    still = points.copy()
    still[GONE, gone] = points[GONE.start, gone]
    frames = confidence(seen(still, found), score).frames
    assert frames[GONE][10:-10].max() < 0.5
    assert frames[: GONE.start - 40].min() > 0.8
    assert frames[GONE.stop + 40 :].min() > 0.8


def test_titles_are_no_doubt(score, points):
    """What shows no keyboard is counted apart, and does not lower what is shown about it."""
    missing = np.zeros(len(points), bool)
    missing[GONE] = True
    found = np.repeat(~missing[:, None], 2, axis=1)
    still = points.copy()
    still[GONE] = points[GONE.start]
    made = confidence(seen(still, found), score, missing=missing)
    assert made.frames[GONE].max() == 0
    assert not made.in_doubt.any()
    assert made.mean > 0.9 > made.frames.mean()
    verdict = judge(made, [])
    assert verdict.grade == "usable"  # the fingers of notes in it are guesses
    assert "in doubt" not in verdict.line
    assert "3.0 s more show no keyboard" in verdict.line
    assert on_lost_hands(seen(still, found), missing) == []
    silent = ~((score.onset >= GONE.start / 20) & (score.onset < GONE.stop / 20))
    rest = replace(
        score,
        **{name: getattr(score, name)[silent] for name in ("key", "onset", "offset", "velocity")},
    )
    assert judge(confidence(seen(still, found), rest, missing=missing), []).grade == "good"


def test_a_single_frame_is_interpolated_well(score, points):
    found = np.ones(points.shape[:2], bool)
    found[100] = False
    assert confidence(seen(points, found), score).frames[100] > 0.8


def test_notes_with_no_finger_near(score, points):
    """For three seconds the notes are elsewhere than the hands."""
    away = points.copy()
    away[GONE, ..., 1] += 0.3
    made = confidence(seen(away), score)
    assert made.frames[GONE][10:-10].max() < 0.3
    assert made.frames[: GONE.start - 60].min() > 0.7
    onset = score.note_frames()[:, 0]
    inside = (onset >= GONE.start) & (onset < GONE.stop - 2)
    assert not made.supported[inside].any()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_another_song(points, seed):
    other = wandering(seed)
    made = confidence(seen(points), other)
    assert made.agreement.beyond_chance < 0.4
    assert made.frames.mean() < 0.4
    remarks = on_agreement(made, "other.mid", 0.0)
    assert judge(made, remarks).grade == "doubtful"
    assert "may not be what is played" in remarks[0].text
    assert "--" in remarks[0].action


@pytest.mark.parametrize("seconds", [-2.0, 1.5, 3.0])
def test_a_time_shift(score, points, seconds):
    inside = score.clip(3.0, SECONDS - 4.0)
    moved = later(inside, 3.0 + seconds)
    made = confidence(seen(points), moved)
    assert made.frames.mean() < 0.5
    # Fingers are over their keys before the notes begin.
    assert made.better.seconds == pytest.approx(-seconds, abs=0.5)
    (remark,) = on_agreement(made, "song.mid", 5.0)
    assert f"--offset {5.0 + made.better.seconds:.1f}" in remark.action
    assert judge(made, [remark]).grade == "doubtful"


@pytest.mark.parametrize("ratio", [0.9, 1.1, 1.2])
def test_slow_motion_with_a_sound_of_usual_speed(score, points, ratio):
    heard = replace(score, onset=score.onset / ratio, offset=score.offset / ratio)
    made = confidence(seen(points), heard)
    assert made.tempo.ratio == pytest.approx(ratio, abs=0.02)
    (remark,) = on_agreement(made, SOUND, 0.0)
    percent = round(abs(100 * (made.tempo.ratio - 1)))
    way = "slower" if ratio > 1 else "faster"
    assert f"{percent} % {way} than its sound" in remark.text
    assert judge(made, [remark]).grade != "good"


@pytest.mark.parametrize("keys", [-12, -2, 1, 12])
def test_keys_that_are_named_wrongly(score, points, keys):
    made = confidence(seen(points), score.transpose(keys))
    assert made.frames.mean() < 0.3
    assert made.better.keys == -keys
    (remark,) = on_agreement(made, "song.mid", 0.0)
    assert ("an octave" in remark.text) == (abs(keys) == 12)
    assert ("lower" in remark.text) == (keys > 0)


def test_fingers_that_lie_on_all_keys_prove_nothing():
    """Ten keys under ten fingers that do not move: any music on them would agree as well."""
    points = np.zeros((200, 2, 6, 2), np.float32)
    points[..., 1] = np.linspace(-0.2, 0.2, 12).reshape(2, 6)
    made_up_notes = made_up.song(8.0)
    far = confidence(seen(points), made_up_notes)
    assert far.agreement.beyond_chance < 0.4


def test_three_notes_prove_little(score, points):
    made = confidence(seen(points), score.clip(0.0, 0.9))
    assert 0 < made.agreement.beyond_chance < 0.7


def test_notes_that_may_be_shade(score, points):
    made = confidence(seen(points), score, certainty=0.3)
    assert made.frames.max() <= 0.3


def keys_as_seen(shift=0):
    """(60, 3, 88, 3) white and black keys, named too high by so many white keys."""
    light = np.full((60, 3, 88, 3), 20, np.uint8)
    whites = np.flatnonzero(~BLACK)
    place = np.searchsorted(whites, np.arange(88))
    for key in range(88):
        if BLACK[key]:  # what lies between the white keys beside it, so many further
            lower = whites[min(place[key] - 1 + shift, len(whites) - 2)]
            light[:, :, key] = 30 if BLACK[lower + 1] else 220
        else:
            light[:, :, key] = 220
    return light


def test_keys_where_they_should_be_and_elsewhere():
    with LightRecord.of(keys_as_seen()) as record:
        look = look_at_keyboard(record)
    assert look.pattern > 0.95
    assert look.usual.min() > 0.95
    assert on_keyboard(look) == []
    for shift in (1, 2, 3, 4, 5, 6):
        with LightRecord.of(keys_as_seen(shift)) as record:
            shifted = look_at_keyboard(record)
        assert shifted.pattern < look.pattern - 0.2


def test_a_keyboard_that_is_not_there(score, points):
    light = keys_as_seen()
    light[40:50] = np.roll(light[40:50], 3, axis=2)  # moved
    light[50:] = 128  # hidden
    with LightRecord.of(light) as record:
        look = look_at_keyboard(record)
    assert look.usual[:40].min() > 0.95
    assert look.usual[40:].max() < 0.5
    lost = usual(len(points))
    lost.usual[GONE] = 0.3
    made = confidence(seen(points), score, lost)
    assert made.frames[GONE].max() == 0
    (remark,) = on_keyboard(lost)
    assert (remark.weight, judge(made, [remark]).grade) == ("check", "usable")
    shifted = confidence(seen(points), score, KeyboardLook(0.5, lost.usual))
    assert shifted.frames.max() == 0


def test_repairs_are_counted(score, points):
    found = np.ones(points.shape[:2], bool)
    found[10:13, LEFT] = False
    tracks = HandTracks(points, found, np.zeros(points.shape[:3], bool), 7, 2)
    tips = raised(points, score.frames())
    fingers = find_note_fingers(score, tips, tracks.seen)
    made = confidence(tracks, score)
    plan = align(score, tips, fingers)
    counts = {each.name: each.count for each in list_repairs(tracks, plan, made, 4)}
    assert counts["left_hand_interpolated"] == 3
    assert counts["right_hand_interpolated"] == 0
    assert counts["detections_left_out"] == 7
    assert counts["hands_swapped_back"] == 2
    assert counts["notes_outside"] == 4
    assert counts["fingers_guessed"] == (~made.supported).sum()


def test_the_verdict_says_what_to_do(score, points):
    made = confidence(seen(points), score)
    wrong = Remark("the grid is off", "mark it with `pianomime pick`", "wrong")
    check = Remark("the octave is open", "name it with --octave", "check")
    assert judge(made, [check]).grade == "usable"
    verdict = judge(made, [check, wrong])
    assert verdict.grade == "doubtful"
    assert wrong.action in verdict.line

from __future__ import annotations

import numpy as np
import pytest

import made_up_video as made_up
from pianomime.keyboard import NO_KEY
from pianomime.music import Score, onset_f1
from pianomime.video.align import align, raised
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks, nobody
from pianomime.video.notes.fingers import find_note_fingers
from pianomime.video.notes.key_light import ZONES
from pianomime.video.notes.lit import are_lit
from pianomime.video.notes.offset import estimate_offset
from pianomime.video.notes.reading import read_notes
from pianomime.video.parallax import correct_parallax
from pianomime.world.parameters import key_centres

DARK = 40
BOTH = np.array([True, True])


@pytest.fixture(scope="module")
def score():
    return made_up.song(8.0)


@pytest.fixture(scope="module")
def plan(score):
    return made_up.plan_of(score)


@pytest.fixture(scope="module")
def points(plan):
    return plan.fingertips[..., :2]


def tracks(points):
    shape = points.shape
    return HandTracks(points, np.ones(shape[:2], bool), np.zeros(shape[:3], bool), 0, 0)


def lamps(score, frames, spill=0.6, late=0):
    """(T, 3, 88, 3): keys light up in the first zone, and their neighbours a little."""
    light = np.full((frames, 3, 88, 3), DARK, float)
    for key, onset, offset in zip(score.key, score.onset, score.offset, strict=True):
        first, end = int(onset * 20) + late, int(np.ceil(offset * 20)) + late
        for near, share in ((key, 1.0), (key - 1, spill), (key + 1, spill)):
            now = light[first:end, 0, near]
            light[first:end, 0, near] = np.maximum(now, DARK + share * np.array([0, 90, 200]))
    light += np.random.default_rng(0).normal(0, 2, light.shape)
    return np.clip(light, 0, 255).astype(np.uint8)


def notes_read(light, tracks, title, missing=None):
    with LightRecord.of(light) as record:
        missing = np.zeros(len(light), bool) if missing is None else missing
        return read_notes(record, tracks, missing, title)


def offset_of(score, tracks, light):
    with LightRecord.of(light) as record:
        return estimate_offset(score, tracks, record, np.zeros(len(tracks), bool))


def test_notes_are_read_off_light_that_spills(score, points):
    read = notes_read(lamps(score, len(points)), tracks(points), "read")
    assert onset_f1((score.key, score.onset), (read.score.key, read.score.onset), 0.1) > 0.97
    assert read.touched > 0.9
    assert read.lit
    assert read.confidence > 0.9
    assert read.score.title == "read"


def test_a_key_that_is_down_most_of_the_time_is_read(score, points):
    """The left little finger holds a key from 1.2 s on, and lies elsewhere before."""
    held = Score([10], [1.2], [len(points) / 20], [80])
    holding = points.copy()
    holding[:, 0, 5] = key_centres()[4, :2]
    holding[24:, 0, 5] = key_centres()[10, :2]
    light = np.maximum(lamps(score, len(points)), lamps(held, len(points), 0.0))
    read = notes_read(light, tracks(holding), "read").score
    assert read.onset[read.key == 10] == pytest.approx([1.2], abs=0.051)


@pytest.mark.parametrize(
    ("rest", "down"),
    [
        ((200, 190, 170), (160, 150, 130)),
        ((100, 130, 190), (60, 90, 150)),  # in blue light
        ((90, 92, 98), (195, 200, 212)),  # where they reflect a window
    ],
)
def test_keys_that_only_go_down_are_not_lit(score, points, rest, down):
    """They change, where fingers are, by as much as some lights would change them."""
    light = np.full((len(points), 3, 88, 3), rest, np.uint8)
    for key, onset, offset in zip(score.key, score.onset, score.offset, strict=True):
        light[int(onset * 20) : int(np.ceil(offset * 20)), :, key] = down
    read = notes_read(light, tracks(points), "read")
    assert not read.lit
    assert read.confidence == 1
    assert len(read.score) == 0


def over(zone):
    """World x of the middle of a zone [m]."""
    return np.mean(list(ZONES.values())[zone])


def covers(points, zone, colour):
    """(T, 3, 88, 3): keys have a colour in one zone where a finger is over them."""
    light = np.full((len(points), 3, 88, 3), DARK, np.uint8)
    off = np.abs(points[:, :, 1:, None, 1] - key_centres()[:, 1]).min(axis=(1, 2))
    light[:, zone][off < 0.008] = colour
    return light


@pytest.mark.parametrize("colour", [(178, 131, 121), (110, 74, 50), (60, 40, 150)])
def test_a_hand_over_keys_is_no_light(score, points, colour):
    """Bare, pale or dark, or in a glove, it changes keys as fingers go, far up between them."""
    reaching = points.copy()
    reaching[..., 1:, 0] = over(2) - 0.01
    read = notes_read(covers(reaching, 2, colour), tracks(reaching), "hand")
    assert not read.lit
    assert len(read.score) == 0


def test_skin_is_no_light_where_no_hand_was_found(score, points):
    light = covers(points, 2, (190, 140, 130))
    assert not notes_read(light, nobody(len(points)), "hand").lit


def test_light_under_a_hand_has_the_hue_of_light_elsewhere():
    """Of six keys that light up alike, a hand lies over the last three; over a seventh, a glove."""
    light = np.full((200, 3, 88, 3), DARK, np.uint8)
    notes = np.array([[20 + 3 * number, 10 + 20 * number, 20 + 20 * number] for number in range(7)])
    points = np.full((200, 1, 6, 2), 5.0)
    for number, (key, first, end) in enumerate(notes):
        light[first:end, 1, key] = (150, 60, 60) if number == 6 else (30, 90 + 10 * number, 220)
        if number >= 3:
            points[first:end, 0] = (over(1), key_centres()[key, 1])
    usual = np.full((88, 3), DARK, np.float32)
    with LightRecord.of(light) as record:
        lit = are_lit(record, 1, usual, notes, points)
        np.testing.assert_array_equal(lit, [True] * 6 + [False])
        # Without the three that no hand is over, nothing tells light from a glove.
        assert not are_lit(record, 1, usual, notes[3:], points).any()


def test_notes_are_read_where_there_are_no_hands(score, points):
    read = notes_read(lamps(score, len(points)), nobody(len(points)), "falling notes")
    assert read.lit
    assert onset_f1((score.key, score.onset), (read.score.key, read.score.onset), 0.1) > 0.97


@pytest.mark.parametrize("seconds", [0.5, 2.0])
@pytest.mark.parametrize("comes_back", [False, True])
def test_light_that_is_not_shown(seconds, comes_back):
    """In a title nothing is lit, unless it is short, and the key is lit before and after it."""
    light = np.full((160, 3, 88, 3), DARK, np.uint8)
    for number, key in enumerate((20, 30, 40, 50)):
        light[8 * number : 8 * number + 6, 1, key] = (30, 90, 220)
    gap = slice(50, 50 + round(20 * seconds))
    light[40 : gap.stop + 10 * comes_back, 1, 60] = (30, 90, 220)  # as it was seen last
    missing = np.zeros(160, bool)
    missing[gap] = True
    read = notes_read(light, nobody(160), "title", missing).score
    spans = np.stack((read.onset, read.offset), axis=1)[read.key == 60] * 20
    before, after = [40, 50], [gap.stop, gap.stop + 10]
    bridged = comes_back and seconds < 1
    expected = [[40, after[1]]] if bridged else [before, after] if comes_back else [before]
    np.testing.assert_allclose(spans, expected)


def test_nothing_is_read_off_noise(points):
    light = np.random.default_rng(0).integers(38, 42, (len(points), 3, 88, 3)).astype(np.uint8)
    read = notes_read(light, tracks(points), "noise")
    assert not read.lit
    assert len(read.score) == 0


@pytest.mark.parametrize("late", [-1.5, 0.0, 2.0])
def test_offset_from_fingers_and_light(score, points, late):
    """The music begins before the video, with it, or after it."""
    if late < 0:
        first = round(-20 * late)
        seen, light = points[first:], lamps(score, len(points))[first:]
    else:
        pad = np.repeat(points[:1], round(20 * late), axis=0)
        seen = np.concatenate((pad, points))
        moved = Score(score.key, score.onset + late, score.offset + late, score.velocity)
        light = lamps(moved, len(seen))
    dark = np.full_like(light, DARK)
    by_fingers = offset_of(score, tracks(seen), dark)
    # Fingers are over their keys for a while before and after.
    assert by_fingers.seconds == pytest.approx(late, abs=0.3)
    assert by_fingers.touched > by_fingers.by_chance + 0.15
    assert offset_of(score, tracks(seen), light).seconds == pytest.approx(late, abs=0.051)


def test_a_repeat_is_not_taken_for_the_beginning():
    """The theme comes twice, and the second time the fingers are seen less well."""
    theme = made_up.song(5.0)
    score = Score(
        np.concatenate((theme.key, theme.key)),
        np.concatenate((theme.onset, theme.onset + 4.5)),
        np.concatenate((theme.offset, theme.offset + 4.5)),
        np.full(2 * len(theme), 80),
    )
    points = made_up.plan_of(score).fingertips[..., :2].copy()
    second = points[100:]
    second += np.random.default_rng(0).normal(0, 0.007, second.shape)
    dark = np.full((len(points), 3, 88, 3), DARK, np.uint8)
    assert offset_of(score, tracks(points), dark).seconds == pytest.approx(0, abs=0.3)


def test_another_song_does_not_match(points):
    draw = np.random.default_rng(5)
    onset = np.sort(draw.uniform(0, 7, 60))
    other = Score(draw.integers(10, 70, 60), onset, onset + 0.2, np.full(60, 80))
    dark = np.full((len(points), 3, 88, 3), DARK, np.uint8)
    found = offset_of(other, tracks(points), dark)
    assert found.touched < 0.7


def test_fingers_are_those_that_were_there(score, plan, points):
    noisy = points + np.random.default_rng(0).normal(0, 0.002, points.shape)
    found = find_note_fingers(score, noisy, BOTH)
    played = plan.note_hand >= 0
    same = (found.hand == plan.note_hand) & (found.finger == plan.note_finger)
    assert same[played].mean() > 0.97
    assert not found.guessed[played].any()


def test_no_finger_plays_two_keys_at_once(points):
    chord = Score([40, 41, 42, 43, 44, 45], [1.0] * 6, [2.0] * 6, [80] * 6)
    found = find_note_fingers(chord, points[:41], BOTH)
    assert len(set(zip(found.hand.tolist(), found.finger.tolist(), strict=True))) == 6


def test_a_key_struck_again_in_the_last_frame(points):
    again = Score([40, 40], [0.5, 1.96], [1.96, 1.98], [80, 80])
    found = find_note_fingers(again, points[: again.frames()], BOTH)
    assert np.isfinite(found.misfit).all()


def test_a_hand_that_is_made_up_plays_only_what_is_far_from_the_other(score, plan, points):
    right = np.array([False, True])
    played = plan.note_hand == 1
    lying = points.copy()
    lying[:, 0] = points[:, 1]  # it would fit as well
    found = find_note_fingers(score, lying, right)
    assert (found.hand[played] == 1).all()
    assert found.guessed[found.hand == 0].all()


def test_steady_alignment(score, points):
    fingers = find_note_fingers(score, points, BOTH)
    plan = align(score, raised(points, score.frames()), fingers)
    frame, hand, finger = np.nonzero(plan.finger_key != NO_KEY)
    tips = plan.fingertips[frame, hand, finger + 1]
    keys = plan.finger_key[frame, hand, finger]
    np.testing.assert_allclose(tips[:, 1], key_centres()[keys, 1], atol=1e-9)
    assert (tips[:, 2] == 0).all()
    # No finger slides on its key.
    held = (plan.finger_key[1:] == plan.finger_key[:-1]) & (plan.finger_key[1:] != NO_KEY)
    step = np.abs(np.diff(plan.fingertips[:, :, 1:], axis=0))
    assert step[held].max() < 1e-9
    # And far from any note the human is left alone.
    assert np.abs(plan.fingertips[0, :, :, :2] - points[0]).max() < 1e-9
    np.testing.assert_array_equal(plan.keys() & ~score.roll(), False)


def test_parallax_is_taken_back(score, points):
    bent = points.copy()
    bent[..., 1] = 1.03 * bent[..., 1] + 0.003
    fingers = find_note_fingers(score, points, BOTH)
    before = np.abs(bent - points)[..., 1].mean()
    correct_parallax(bent, score, fingers)
    assert np.abs(bent - points)[..., 1].mean() < 0.6 * before

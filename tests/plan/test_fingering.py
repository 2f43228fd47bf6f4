"""Laws of the fingering: any music, each finger on one key, dropped notes counted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from any_score import chord, melody, score_of, scores
from pianomime.keyboard import BLACK
from pianomime.music import Score
from pianomime.plan import LEFT, RIGHT
from pianomime.plan import fingering_cost as hand_cost_module
from pianomime.plan import reach as reach_module
from pianomime.plan.fingering import Fingering, find_fingering
from pianomime.songs.find import find_song
from pianomime.world.parameters import key_centres

MIRROR = 82
"""Key k and key 82 - k are mirror images about D4: both black or both white."""


def on_fingers(score: Score, fingering: Fingering) -> list[tuple[int, tuple[int, int, int, int]]]:
    """Each played note that sounds at all, with its (hand, finger, key, first frame)."""
    first, end = score.note_frames().T
    table = np.column_stack([fingering.hand, fingering.finger, score.key, first]).tolist()
    notes = np.flatnonzero((fingering.hand >= 0) & (first < end)).tolist()
    return [(note, tuple(table[note])) for note in notes]


@settings(max_examples=60, deadline=None)
@given(score=scores(most_notes=40))
def test_any_score_gets_a_fingering(score: Score) -> None:
    fingering = find_fingering(score)
    assert fingering.hand.shape == fingering.finger.shape == (len(score),)
    played = fingering.hand >= 0
    assert set(fingering.hand.tolist()) <= {-1, LEFT, RIGHT}
    assert ((fingering.finger[played] >= 0) & (fingering.finger[played] < 5)).all()
    assert (fingering.finger[~played] == -1).all()


@settings(max_examples=60, deadline=None)
@given(score=scores(most_notes=40))
def test_a_finger_plays_one_key_at_a_time(score: Score) -> None:
    fingering = find_fingering(score)
    busy: dict[tuple[int, int, int], int] = {}
    for note, (hand, finger, key, _) in on_fingers(score, fingering):
        for frame in range(int(fingering.start[note]), int(fingering.stop[note])):
            assert busy.setdefault((hand, finger, frame), key) == key


@settings(max_examples=60, deadline=None)
@given(score=scores(most_notes=40))
def test_notes_are_cut_short_at_most(score: Score) -> None:
    fingering = find_fingering(score)
    first, end = score.note_frames().T
    played = fingering.hand >= 0
    assert (fingering.start >= first).all()
    assert (fingering.stop <= end).all()
    assert (fingering.stop > fingering.start)[played & (first < end)].all()


@pytest.mark.parametrize("lasts", [(20, 1), (1, 20)], ids=["early", "late"])
def test_a_leap_takes_frames_from_what_has_some_to_spare(lasts: tuple[int, int]) -> None:
    """Both hands leap at once; of a note of one frame nothing would be left."""
    then = 20 + lasts[0]
    low, high = [15, 22, 34, 39], [46, 51, 67, 74]
    score = score_of(
        *((key, 20, then) for key in low), *((key, then, then + lasts[1]) for key in high)
    )
    fingering = find_fingering(score)
    first, end = score.note_frames().T
    played = fingering.hand >= 0
    assert (played & (fingering.stop < end)).any() == (lasts[0] > 1)
    assert (played & (fingering.start > first)).any() == (lasts[1] > 1)


@settings(max_examples=60, deadline=None)
@given(score=scores(most_notes=40))
def test_a_key_is_struck_by_one_finger_at_a_time(score: Score) -> None:
    """Also where two voices strike it, of which one has no frame of its own."""
    fingering = find_fingering(score)
    first = score.note_frames()[:, 0]
    players: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for note, (key, frame) in enumerate(zip(score.key.tolist(), first.tolist(), strict=True)):
        who = (int(fingering.hand[note]), int(fingering.finger[note]))
        players.setdefault((key, frame), set()).add(who)
    assert max(map(len, players.values()), default=1) == 1


@settings(max_examples=40, deadline=None)
@given(keys=st.sets(st.integers(20, 66), min_size=1, max_size=9))
def test_fingers_of_a_hand_do_not_cross_in_a_chord(keys: set[int]) -> None:
    score = chord(sorted(keys))
    fingering = find_fingering(score)
    for hand, thumb_low in ((LEFT, False), (RIGHT, True)):
        fingers = fingering.finger[fingering.hand == hand].astype(int)
        assert (np.diff(fingers if thumb_low else -fingers) > 0).all()


@pytest.mark.parametrize("notes", range(1, 25))
def test_every_polyphony(notes: int) -> None:
    score = chord(list(range(30, 30 + notes)))
    fingering = find_fingering(score)
    dropped = int((fingering.hand < 0).sum())
    assert dropped >= max(0, notes - 10)
    assert dropped < notes


@pytest.mark.parametrize("notes", [7, 8, 9, 10])
def test_of_chords_wider_than_two_hands_some_is_played(notes: int) -> None:
    fingering = find_fingering(chord(list(range(0, 9 * notes, 9))))
    assert (fingering.hand >= 0).sum() >= 2


@settings(max_examples=40, deadline=None)
@given(score=scores(most_notes=40))
def test_a_hand_that_comes_late_strikes_nothing_before(score: Score) -> None:
    fingering = find_fingering(score)
    first, end = score.note_frames().T
    for hand in (LEFT, RIGHT):
        mine = np.flatnonzero((fingering.hand == hand) & (first < end))
        order = mine[np.argsort(first[mine], kind="stable")]
        # A later note starts later than any before it that is still held then.
        for place, note in enumerate(order):
            earlier = order[:place][first[order[:place]] < first[note]]
            held = earlier[fingering.stop[earlier] > fingering.start[note]]
            assert (fingering.start[held] <= fingering.start[note]).all()


def test_a_hand_does_not_play_on_its_way_to_a_late_note() -> None:
    bass = [(5, 0, 60), (12, 0, 60)]
    leap = [(50, 10, 20), (53, 10, 20), (82, 20, 40), (85, 21, 40), (86, 22, 40)]
    score = score_of(*bass, *leap)
    fingering = find_fingering(score)
    right = np.flatnonzero((fingering.hand == RIGHT) & (score.key > 80))
    assert (np.diff(fingering.start[right]) >= 0).all()


def test_all_keys_at_once() -> None:
    fingering = find_fingering(chord(list(range(88))))
    assert 0 < (fingering.hand >= 0).sum() <= 10


@pytest.mark.parametrize("keys", [[0], [87], [0, 87], [39], [1, 86]])
def test_single_notes_and_the_ends_of_the_keyboard(keys: list[int]) -> None:
    fingering = find_fingering(chord(keys))
    assert (fingering.hand >= 0).all()


def test_a_triad_is_played_whole_by_hands_that_are_near() -> None:
    fingering = find_fingering(chord([51, 55, 58]))
    assert (fingering.hand == RIGHT).all()
    fingering = find_fingering(chord([27, 31, 34]))
    assert (fingering.hand == LEFT).all()


def test_hands_share_what_is_far_apart() -> None:
    fingering = find_fingering(chord([20, 27, 55, 62]))
    np.testing.assert_array_equal(fingering.hand, [LEFT, LEFT, RIGHT, RIGHT])


def test_a_stretch_beyond_ten_fingers_is_dropped_not_refused() -> None:
    keys = np.array([0, 12, 44, 66, 76])
    fingering = find_fingering(chord(list(keys)))
    assert 1 <= (fingering.hand < 0).sum() <= 3
    for hand in (LEFT, RIGHT):
        along = key_centres()[keys[fingering.hand == hand], 1]
        assert np.ptp(along) < 0.24


def test_two_voices_on_one_key_share_a_finger() -> None:
    fingering = find_fingering(score_of((50, 4, 8), (50, 4, 12)))
    assert fingering.hand[0] == fingering.hand[1] >= 0
    assert fingering.finger[0] == fingering.finger[1]


def test_no_notes() -> None:
    empty = Score(np.array([], int), np.array([]), np.array([]), np.array([], int))
    assert find_fingering(empty).hand.shape == (0,)


def test_a_held_note_keeps_its_finger_busy() -> None:
    score = score_of((51, 4, 40), (53, 10, 14), (55, 20, 24), (56, 30, 34))
    fingering = find_fingering(score)
    held = (fingering.hand[0], fingering.finger[0])
    others = set(zip(fingering.hand[1:].tolist(), fingering.finger[1:].tolist(), strict=True))
    assert held[0] >= 0
    assert held not in others


def test_the_keyboard_has_a_mirror() -> None:
    keys = np.arange(MIRROR + 1)
    np.testing.assert_array_equal(BLACK[keys], BLACK[MIRROR - keys])
    along = key_centres()[:, 1]
    middle = along[MIRROR // 2]
    np.testing.assert_allclose(along[keys] - middle, middle - along[MIRROR - keys], atol=1.1e-3)


@pytest.fixture
def symmetric_keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A keyboard whose mirror is exact, and in the middle between the resting hands."""
    along = key_centres()[:, 1].copy()
    keys = np.arange(MIRROR + 1)
    along[keys] = (along[keys] - along[MIRROR - keys]) / 2
    exact = along[:, None][:, [0, 0, 0]]
    for module in (hand_cost_module, reach_module):
        monkeypatch.setattr(module, "key_centres", lambda: exact)
    reach_module.stretch.cache_clear()
    hand_cost_module.pair_cost.cache_clear()
    yield
    reach_module.stretch.cache_clear()
    hand_cost_module.pair_cost.cache_clear()


@pytest.mark.usefixtures("symmetric_keyboard")
@pytest.mark.parametrize(
    "score",
    [
        melody([51, 53, 55, 56, 58]),
        melody([39, 51, 43, 55, 46, 58]),
        melody([31, 34, 39, 43, 46, 51]),
        melody([44, 46, 48, 49]),
        chord([27, 31, 34, 51, 55, 58]),
        chord([51, 55, 58]),
        *(
            Score.from_midi(find_song(song)).clip(0.0, 10.0)
            for song in ("bach-prelude-c", "beethoven-fur-elise", "satie-gymnopedie-1")
        ),
    ],
)
def test_mirrored_music_swaps_the_hands(score: Score) -> None:
    """Law: the hands are alike, so a mirrored score is played with mirrored hands."""
    mirrored_score = Score(MIRROR - score.key, score.onset, score.offset, score.velocity)
    fingering, mirrored = find_fingering(score), find_fingering(mirrored_score)
    # Notes of a chord are in order of their keys.
    order = np.lexsort((-mirrored_score.key, mirrored_score.onset))
    swapped = np.where(fingering.hand >= 0, 1 - fingering.hand, -1)
    np.testing.assert_array_equal(mirrored.hand[order], swapped)
    np.testing.assert_array_equal(mirrored.start[order], fingering.start)
    np.testing.assert_array_equal(mirrored.stop[order], fingering.stop)
    np.testing.assert_array_equal(mirrored.finger[order], fingering.finger)


def test_octaves_are_alike() -> None:
    """What one hand plays is fingered alike an octave higher, once the hand is there.

    The other hand holds a bass note.
    """
    keys = [51, 53, 55, 56, 58, 56, 55, 53] * 3

    def play(shift: int) -> Fingering:
        notes = [(key + shift, 20 + 6 * place, 26 + 6 * place) for place, key in enumerate(keys)]
        return find_fingering(score_of((12, 0, 20 + 6 * len(keys)), *notes))

    low, high = play(0), play(12)
    assert (low.hand[1:] == RIGHT).all()
    np.testing.assert_array_equal(low.hand, high.hand)
    np.testing.assert_array_equal(low.finger[9:], high.finger[9:])


def test_is_deterministic() -> None:
    score = Score.from_midi(find_song("beethoven-fur-elise")).clip(0.0, 8.0)
    one, other = find_fingering(score), find_fingering(score)
    np.testing.assert_array_equal(one.hand, other.hand)
    np.testing.assert_array_equal(one.finger, other.finger)

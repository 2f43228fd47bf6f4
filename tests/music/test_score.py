"""Laws of scores, rolls and note frames."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pianomime.music import Score, ScoreError, notes_from_roll

# Times that floats hold exactly, so that laws hold exactly too.
TIMES = st.integers(0, 6 * 64).map(lambda n: n / 64)


@st.composite
def scores(draw: st.DrawFn) -> Score:
    notes = draw(
        st.lists(
            st.tuples(st.integers(0, 87), TIMES, TIMES, st.integers(1, 127)),
            min_size=1,
            max_size=30,
        )
    )
    # Few keys, so that many notes meet on one.
    crowd = draw(st.integers(1, 88))
    key, onset, length, velocity = zip(*notes, strict=True)
    pedal = draw(st.lists(st.tuples(TIMES, TIMES), max_size=4))
    return Score(
        key=np.array(key) % crowd,
        onset=np.array(onset),
        offset=np.array(onset) + np.array(length) / 8,
        velocity=np.array(velocity),
        pedal=np.array([(on, on + length) for on, length in pedal]),
    )


def score_of(*notes: tuple[int, float, float]) -> Score:
    """Notes as (key, onset frame, offset frame)."""
    key, onset, offset = (np.array(column) for column in zip(*notes, strict=True))
    return Score(key, onset / 20, offset / 20, np.full(len(key), 64))


def down(score: Score, key: int) -> str:
    return "".join(".#"[int(cell)] for cell in score.roll()[:, key])


def test_notes_are_sorted_read_only_and_counted() -> None:
    score = Score([5, 3, 4], [1.0, 1.0, 0.5], [2.0, 3.0, 1.0], [10, 20, 30])
    assert score.key.tolist() == [4, 3, 5]
    assert score.velocity.tolist() == [30, 20, 10]
    assert len(score) == 3
    assert score.duration == 3.0
    with pytest.raises(ValueError, match="read-only"):
        score.key[0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        score.title = "other"  # type: ignore[misc]


@pytest.mark.parametrize(
    "arrays",
    [
        ([88], [0.0], [1.0], [64]),
        ([-1], [0.0], [1.0], [64]),
        ([1], [0.0], [1.0], [0]),
        ([1], [0.0], [1.0], [128]),
        ([1], [1.0], [0.5], [64]),
        ([1], [-0.5], [0.5], [64]),
        ([1], [np.nan], [0.5], [64]),
        ([1], [0.0], [np.inf], [64]),
        ([1, 2], [0.0], [1.0], [64]),
        ([1], [0.0], [1.0], [64], [[1.0, 0.5]]),
        ([1], [0.0], [1.0], [64], [1.0, 0.5, 1.0]),
    ],
)
def test_senseless_arrays_are_refused(arrays: tuple[list[float], ...]) -> None:
    with pytest.raises(ScoreError):
        Score(*arrays)


def test_frames_are_floor_and_ceil_and_at_least_one() -> None:
    assert down(score_of((0, 1.5, 3.2)), 0) == ".###"
    assert down(score_of((0, 1.0, 3.0)), 0) == ".##."  # one frame after an end on the grid
    assert down(score_of((0, 2.0, 2.0)), 0) == "..#"
    assert down(score_of((0, 2.9, 2.9)), 0) == "..#"


def test_key_struck_again_is_released_for_one_frame() -> None:
    assert down(score_of((0, 0, 3), (0, 3, 6)), 0) == "###.##."
    assert down(score_of((0, 0, 5), (0, 3, 6)), 0) == "###.##."
    assert down(score_of((0, 0, 2), (0, 3, 6)), 0) == "##.###."
    # A long note sounds on under a short one.
    assert down(score_of((0, 0, 6), (0, 3, 4)), 0) == "###.##."


def test_note_struck_again_lasts_at_least_one_frame() -> None:
    assert down(score_of((0, 0, 3), (0, 3, 4), (1, 0, 9)), 0) == "###.#....."


def test_strikes_in_every_frame_alternate() -> None:
    score = score_of(*((0, frame, frame + 1) for frame in range(6)), (1, 0, 9))
    assert down(score, 0) == "#.#.#.#..."[:10]
    first, stop = score.note_frames()[score.key == 0].T
    assert ((stop - first) > 0).tolist() == [True, False, True, False, True, True]


def test_two_notes_in_one_frame_are_one() -> None:
    score = score_of((0, 1.2, 2.0), (0, 1.6, 4.0))
    assert down(score, 0) == ".###."
    assert score.note_frames().tolist() == [[1, 1], [1, 4]]


@given(scores())
@settings(max_examples=80, deadline=None)
def test_note_frames_are_the_roll(score: Score) -> None:
    frames = score.note_frames()
    count = np.zeros((score.frames(), 88), int)
    for key, (first, stop) in zip(score.key, frames, strict=True):
        assert 0 <= first <= stop <= len(count)
        count[first:stop, key] += 1
    assert count.max() <= 1
    assert (score.roll() == (count == 1)).all()
    # No two notes run into each other: each is a run of its own in the roll.
    key, onset, offset = notes_from_roll(score.roll())
    played = frames[:, 1] > frames[:, 0]
    assert len(key) == played.sum()
    order = np.lexsort((score.key[played], frames[played, 0]))
    assert (score.key[played][order] == key).all()
    assert (frames[played][order] == np.rint(np.column_stack((onset, offset)) * 20)).all()


@given(scores(), st.integers(-3, 3))
@settings(max_examples=40, deadline=None)
def test_transposing_moves_the_roll(score: Score, semitones: int) -> None:
    if not (score.key.min() + semitones >= 0 and score.key.max() + semitones < 88):
        with pytest.raises(ScoreError):
            score.transpose(semitones)
        return
    assert (score.transpose(semitones).roll() == np.roll(score.roll(), semitones, axis=1)).all()


@given(scores(), TIMES, TIMES)
@settings(max_examples=60, deadline=None)
def test_clipping(score: Score, start: float, length: float) -> None:
    end = start + length + 1 / 64
    sounding = (score.onset < end) & ((score.offset > start) | (score.onset >= start))
    if not sounding.any():
        with pytest.raises(ScoreError, match="no notes between"):
            score.clip(start, end)
        return
    clip = score.clip(start, end)
    assert len(clip) == sounding.sum()
    assert clip.onset.min() >= 0
    assert clip.duration <= end - start
    assert clip.pedal.size == 0 or (clip.pedal.min() >= 0 and clip.pedal.max() <= end - start)
    assert sorted(clip.offset) == sorted(np.minimum(score.offset[sounding], end) - start)
    again = clip.clip(0, end - start)
    assert (again.roll() == clip.roll()).all()
    assert (again.pedal == clip.pedal).all()


def test_clipping_the_whole_changes_nothing() -> None:
    score = score_of((3, 0, 4), (5, 2, 9))
    clip = score.clip(0, 100)
    assert (clip.roll() == score.roll()).all()
    with pytest.raises(ScoreError):
        score.clip(3, 3)


def test_trim_silence() -> None:
    score = Score([1, 2], [2.0, 3.0], [3.0, 4.0], [64, 64], [[1.0, 2.5], [3.0, 4.0]], "t")
    trimmed = score.trim_silence()
    assert trimmed.onset.tolist() == [0.0, 1.0]
    assert trimmed.pedal.tolist() == [[0.0, 0.5], [1.0, 2.0]]
    assert trimmed.title == "t"
    assert (trimmed.roll() == score.roll()[40:]).all()


def test_pedal_of_each_frame() -> None:
    score = Score([0], [0.0], [0.5], [64], [[0.26, 0.31], [0.06, 0.14], [0.11, 0.17]])
    assert score.pedal.tolist() == [[0.06, 0.17], [0.26, 0.31]]
    assert np.flatnonzero(score.pedal_roll()).tolist() == [1, 2, 5]
    held = Score([0], [0.0], [0.5], [64], [[0.3, 0.5]])
    assert np.flatnonzero(held.pedal_roll()).tolist() == [6, 7, 8, 9, 10]


def test_pedal_is_lifted_for_a_frame_and_pressed_for_a_frame() -> None:
    lifted = Score([0], [0.0], [0.6], [64], [[0.0, 0.21], [0.213, 0.4]])
    assert np.flatnonzero(~lifted.pedal_roll()).tolist() == [4, 8, 9, 10, 11, 12]
    pressed = Score([0], [0.0], [0.6], [64], [[0.11, 0.12], [0.31, 0.33]])
    assert np.flatnonzero(pressed.pedal_roll()).tolist() == [2, 6]
    # Faster than there are frames: no press is late by more than a frame.
    trill = Score([0], [0.0], [0.6], [64], [[t / 100, t / 100 + 0.005] for t in range(10, 30)])
    assert np.flatnonzero(trill.pedal_roll()).tolist() == [2, 4]


@given(st.integers(0, 2**32 - 1), st.integers(1, 60))
@settings(max_examples=30, deadline=None)
def test_roll_and_back(seed: int, frames: int) -> None:
    roll = np.random.default_rng(seed).random((frames, 88)) < 0.3
    roll[-1, 0] = True
    score = Score.from_roll(roll)
    assert (score.roll()[:frames] == roll).all()
    assert not score.roll()[frames:].any()


def test_grid_times_are_exact_for_hours() -> None:
    first = np.arange(0, 4 * 3600 * 20 - 1)
    score = Score(first % 88, first / 20, (first + 1) / 20, np.full(len(first), 64))
    frames = score.note_frames()
    order = np.argsort(score.onset)
    assert (frames[order, 0] == first).all()
    assert (frames[order, 1] == first + 1).all()


def near(frame: int, steps: int) -> float:
    """A time so many floats beside the edge of a frame, as sums of times are."""
    time = frame / 20
    for _ in range(abs(steps)):
        time = np.nextafter(time, np.inf if steps > 0 else 0.0)
    return float(time)


EDGES = st.builds(near, st.integers(1, 120), st.integers(-3, 3))


@given(st.lists(st.tuples(st.integers(0, 87), EDGES, EDGES), min_size=1), st.integers(1, 400))
def test_a_delay_of_whole_frames_is_as_many_silent_frames(
    notes: list[tuple[int, float, float]], frames: int
) -> None:
    key, one, other = (np.array(column) for column in zip(*notes, strict=True))
    pedal = [[min(one[0], other[0]), max(one[0], other[0])]]
    on, off = np.minimum(one, other), np.maximum(one, other)
    score = Score(key, on, off, np.full(len(key), 64), np.array(pedal))
    later = score.delay(frames / 20)
    silent = (frames, 0)
    np.testing.assert_array_equal(later.roll(), np.pad(score.roll(), (silent, (0, 0))))
    assert later.duration == pytest.approx(score.duration + frames / 20, abs=1e-12)
    np.testing.assert_allclose(later.onset, np.sort(on) + frames / 20, rtol=0, atol=1e-12)


@given(scores(), st.integers(1, 40))
def test_a_delay_keeps_the_pedal_in_its_frames(score: Score, frames: int) -> None:
    later = score.delay(frames / 20)
    np.testing.assert_array_equal(
        later.pedal_roll(), np.pad(score.pedal_roll(), (frames, 0)), strict=True
    )
    np.testing.assert_array_equal(later.velocity, score.velocity)


def test_a_delay_may_be_any_time_and_none_changes_nothing() -> None:
    score = Score([0, 3], [0.5, 1.0], [1.5, 1.25], [64, 70], [[0.1, 0.7]], "a title", ("a remark",))
    assert score.delay(0.0) is score
    later = score.delay(0.33)
    np.testing.assert_array_equal(later.onset, score.onset + 0.33)
    np.testing.assert_array_equal(later.offset, score.offset + 0.33)
    np.testing.assert_array_equal(later.pedal, score.pedal + 0.33)
    assert (later.title, later.remarks) == (score.title, score.remarks)
    for wrong in (-0.5, float("nan"), float("inf"), 4 * 3600.0):
        with pytest.raises(ScoreError):
            score.delay(wrong)


def test_empty_roll_is_an_empty_score() -> None:
    score = Score.from_roll(np.zeros((10, 88), bool))
    assert len(score) == 0
    assert score.duration == 0
    assert score.roll().shape == (1, 88)
    assert score.pedal_roll().shape == (1,)
    assert score.note_frames().shape == (0, 2)
    assert len(score.trim_silence()) == len(score.delay(0.5)) == 0


def test_roll_of_another_shape_is_refused() -> None:
    with pytest.raises(ScoreError, match=r"\(T, 88\)"):
        Score.from_roll(np.zeros((10, 61), bool))
    with pytest.raises(ValueError, match="dt"):
        score_of((0, 0, 1)).roll(dt=0)


def test_other_frame_lengths() -> None:
    score = Score([0], [0.5], [1.5], [64])
    assert np.flatnonzero(score.roll(dt=0.25)[:, 0]).tolist() == [2, 3, 4, 5]

"""Laws of the fingering where notes count: what an ear misses first is left out last."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

from any_score import chord, score_of, scores
from pianomime.music import Score
from pianomime.plan.fingering import Fingering, find_fingering
from pianomime.plan.fingering_cost import FingeringConfig

FRAMES, NOTES = FingeringConfig(), FingeringConfig.notes()

HELD = ((15, 0, 120), (27, 0, 120), (39, 0, 120), (43, 0, 120))
"""A chord that both hands hold, and must let go in part to play far above it."""
TUNE = ((61, 40, 44), (61, 46, 50))


def left_out(score: Score, config: FingeringConfig) -> list[int]:
    """Keys of the notes that no finger plays."""
    keys: list[int] = score.key[find_fingering(score, config).hand < 0].tolist()
    return keys


def wide_chords() -> list[list[int]]:
    """Chords of five to seven notes of which not all can be played, but all but an inner one."""
    draw = np.random.default_rng(0)
    found: list[list[int]] = []
    while len(found) < 20:
        keys = sorted(draw.choice(np.arange(8, 80), draw.integers(5, 8), replace=False).tolist())
        less = [chord(keys[:place] + keys[place + 1 :]) for place in range(1, len(keys) - 1)]
        whole = left_out(chord(keys), replace(NOTES, drop=1e3))
        if whole and not all(left_out(score, NOTES) for score in less):
            found.append(keys)
    return found


def test_of_a_chord_too_wide_an_inner_note_is_left_out() -> None:
    """Neither melody nor bass, where one note between them will do; frames know no voices."""
    outer = []
    for keys in wide_chords():
        gone = left_out(chord(keys), NOTES)
        assert gone
        assert keys[0] < min(gone) <= max(gone) < keys[-1]
        outer.append({keys[0], keys[-1]} & set(left_out(chord(keys), FRAMES)))
    assert any(outer)


def test_short_melody_notes_are_not_given_up_for_long_inner_ones() -> None:
    """Where frames count they are: they have four each, and what is let go for them many."""
    score = score_of(*HELD, *TUNE)
    assert left_out(score, FRAMES) == [key for key, _, _ in TUNE]
    outer = {HELD[0][0], *(key for key, _, _ in TUNE)}
    assert not outer & set(left_out(score, NOTES))


def test_held_notes_are_let_go_for_struck_ones() -> None:
    score = score_of(*HELD[:2], HELD[3], *TUNE)
    fingering = find_fingering(score, NOTES)
    assert (fingering.hand >= 0).all()
    assert (fingering.stop < score.note_frames()[:, 1]).any()


def lost_frames(score: Score, fingering: Fingering) -> int:
    """Frames of played notes that fingers let go early."""
    played = fingering.hand >= 0
    return int((score.note_frames()[:, 1] - fingering.stop)[played].sum())


def test_held_notes_are_let_go_sooner_under_the_pedal() -> None:
    """They sound on; without it the stretched hand holds them."""
    dry = score_of(
        (10, 0, 60), (20, 0, 60), (47, 0, 60), *((59, 10 + 6 * n, 14 + 6 * n) for n in range(5))
    )
    wet = replace(dry, pedal=np.array([[0.0, dry.duration]]))
    config = replace(NOTES, pedalled=0.0)
    assert lost_frames(wet, find_fingering(wet, config)) > lost_frames(
        dry, find_fingering(dry, config)
    )


@pytest.mark.parametrize(("melody", "bass", "key"), [(50.0, 1.0, 80), (1.0, 50.0, 8)])
def test_each_outer_voice_has_its_own_factor(melody: float, bass: float, key: int) -> None:
    """A leap there and back between chords: too far for a note that counts as others do."""
    thirds = ((30, 34), (43, 47))
    chords = [(low, *when) for both in thirds for low in both for when in ((0, 4), (4, 6), (6, 9))]
    score = score_of(*chords, (key, 4, 6))
    alike = replace(NOTES, melody=1.0, bass=1.0)
    assert left_out(score, alike) == [key]
    assert key not in left_out(score, replace(alike, melody=melody, bass=bass))


@settings(max_examples=60, deadline=None)
@given(score=scores(most_notes=40))
def test_laws_of_any_fingering(score: Score) -> None:
    """As where frames count: one key a finger, late or cut short at most, and something left."""
    fingering = find_fingering(score, NOTES)
    first, end = score.note_frames().T
    played = fingering.hand >= 0
    assert (fingering.start >= first).all()
    assert (fingering.stop <= end).all()
    assert (fingering.stop > fingering.start)[played & (first < end)].all()
    busy: dict[tuple[int, int, int], int] = {}
    for note in np.flatnonzero(played & (first < end)).tolist():
        who = int(fingering.hand[note]), int(fingering.finger[note])
        for frame in range(int(fingering.start[note]), int(fingering.stop[note])):
            assert busy.setdefault((*who, frame), int(score.key[note])) == score.key[note]

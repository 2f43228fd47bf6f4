"""Fingering: a beam search over onsets, for both hands at once.

As in the models of Parncutt et al. (1997, "An ergonomic model of keyboard fingering for melodic
fragments") and Al Kasimi et al. (2007, "A simple algorithm for automatic generation of polyphonic
piano fingerings"), a cost of each chord and of each change from one to the next is minimised over
the piece. The costs are our own, those of the robot's hands: see `fingering_cost`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS, KEYS
from pianomime.music import Score
from pianomime.music.voices import BASS, MELODY, voices
from pianomime.plan.fingering_cost import (
    LATE,
    FingeringConfig,
    Fingers,
    Struck,
    chord_cost,
    hand_cost,
)
from pianomime.plan.fingertip_plan import LEFT, RIGHT
from pianomime.progress import Steps
from pianomime.short_repr import short_repr
from pianomime.world.layout import FINGER_COUNT

_MOST_DROPPED = {7: 4, 8: 4, 9: 3, 10: 3}
"""How many of so many notes struck at once may be dropped, which bounds the number of options.

It is also allowed to play only two of them, one or none. Of six or fewer, any may be dropped.
"""


@dataclass(frozen=True, eq=False)
class Fingering:
    """Hand, finger and frames of the N notes of a score.

    Attributes:
        hand: (N,) int8; 0 left, 1 right, -1 not played.
        finger: (N,) int8; 0 thumb .. 4 little, -1 not played.
        start: (N,) first frame in which the finger presses; later than the note's first frame
            where the hand cannot arrive in time.
        stop: (N,) first frame in which the finger no longer presses; earlier than the note's end
            where the finger or the hand is needed elsewhere.
    """

    hand: NDArray[np.int8]
    finger: NDArray[np.int8]
    start: NDArray[np.int64]
    stop: NDArray[np.int64]

    __repr__ = short_repr


def find_fingering(score: Score, config: FingeringConfig | None = None) -> Fingering:
    """Find a cheap fingering by beam search, onset by onset.

    A note is dropped where no finger can reach it, or where playing it would cost other notes
    more than its value. Of more than ten notes struck at once the inner ones are dropped; where
    more than four of seven or eight, or more than three of nine or ten, are out of reach, all
    but two.

    Args:
        score: the piece.
        config: costs, and width of the beam.
    """
    config = config or FingeringConfig()
    frames = score.note_frames()
    fingering = Fingering(
        np.full(len(score), -1, np.int8),
        np.full(len(score), -1, np.int8),
        frames[:, 0].copy(),
        frames[:, 1].copy(),
    )
    if not len(score):
        return fingering
    value = frame_values(score, config)
    factor = _voice_factors(score, config)
    beam = _Beam.start()
    history = []
    onsets, event = np.unique(frames[:, 0], return_inverse=True)
    groups = np.split(np.argsort(event, kind="stable"), np.cumsum(np.bincount(event))[:-1])
    steps = Steps("fingering", len(onsets))
    for onset, group in zip(onsets, groups, strict=True):
        steps.advance(1)
        # Where two voices strike the same key at once, one finger plays both.
        keys, voice = np.unique(score.key[group], return_inverse=True)
        # A note that covers no frame is fingered as if it had one.
        ends = np.full(len(keys), onset + 1)
        np.maximum.at(ends, voice, frames[group, 1])
        weight = np.zeros(len(keys))
        np.maximum.at(weight, voice, factor[group])
        outer = np.ones(len(keys), bool)
        outer[FINGER_COUNT : len(keys) - FINGER_COUNT] = False
        unit = 1.0 if config.by_note else float(value[onset + 1] - value[onset])
        struck = Struck(int(onset), keys[outer], ends[outer], value, unit)
        beam, choice = beam.extend(struck, weight[outer], config)
        place = np.where(outer, np.cumsum(outer) - 1, -1)[voice]
        history.append((onset, group, place, choice))
    row = int(np.argmin(beam.cost))
    chain = []
    for onset, group, place, choice in reversed(history):
        chain.append((int(onset), group, place, *(array[row] for array in choice[1:])))
        row = int(choice.parent[row])
    sounding = np.full((2, FINGER_COUNT), -1)
    for onset, group, place, let_go, assignment, early, late in reversed(chain):
        mine = np.where(place >= 0, assignment[place], -1)
        played = group[mine >= 0]
        hand, finger = np.divmod(mine[mine >= 0], FINGER_COUNT)
        fingering.hand[played], fingering.finger[played] = hand, finger
        fingering.start[played] = np.minimum(
            onset + late[hand].astype(np.int64), fingering.stop[played]
        )
        side, gone = np.nonzero(let_go & (sounding >= 0))
        cut = sounding[side, gone]
        fingering.stop[cut] = np.minimum(fingering.stop[cut], onset - early[side].astype(np.int64))
        sounding[hand, finger] = played
    return fingering


def frame_values(score: Score, config: FingeringConfig) -> NDArray[np.float64]:
    """(T + 1 + LATE,) Value of a key that is down in all frames before each.

    In one frame it is one over the number of keys that should be down, times the costs of a frame.
    The last `LATE` entries are for frames after the end, into which a note that begins late may
    reach.
    """
    keys = np.concatenate([score.roll().sum(axis=1), np.zeros(LATE)])
    pedal = np.concatenate([score.pedal_roll(), np.zeros(LATE, bool)])
    value = config.frame * np.where(pedal, config.pedalled, 1.0) / np.maximum(keys, 1)
    return np.concatenate([[0.0], np.cumsum(value)])


def _voice_factors(score: Score, config: FingeringConfig) -> NDArray[np.float64]:
    """(N,) Factor of the cost of leaving each note out."""
    factors = np.ones(3)
    factors[[MELODY, BASS]] = config.melody, config.bass
    return factors[voices(score, FRAME_SECONDS)]


class _Choice(NamedTuple):
    """How each of the B rows of a beam came from a row of the beam before it."""

    parent: NDArray[np.int32]  # (B,) row of the beam before
    let_go: NDArray[np.bool_]  # (B, 2, 5) fingers that release their key before the hand strikes
    assignment: NDArray[np.int8]  # (B, M) 0..4 left thumb to little, 5..9 right, -1 not played
    early: NDArray[np.int8]  # (B, 2) frames before the onset by which they have released it
    late: NDArray[np.int8]  # (B, 2) frames after the onset at which the hand strikes


@dataclass(frozen=True, eq=False)
class _Beam:
    """B partial fingerings: the last key of each of ten fingers, and where the hands are."""

    cost: NDArray[np.float64]  # (B,) [key-frames]
    key: NDArray[np.int64]  # (B, 2, 5) last key of each finger, -1 for none yet
    since: NDArray[np.int64]  # (B, 2, 5) frame in which it went down, -1 for none yet
    until: NDArray[np.int64]  # (B, 2, 5) first frame in which the finger is free again
    centre: NDArray[np.float64]  # (B, 2) where the relaxed middle finger is [m]

    @staticmethod
    def start() -> _Beam:
        none = np.full((1, 2, FINGER_COUNT), -1)
        return _Beam(
            np.zeros(1),
            none,
            none,
            np.zeros((1, 2, FINGER_COUNT), np.int64),
            np.array([[-0.14, 0.14]]),
        )

    def _hand(self, side: int, earliest: int) -> tuple[Fingers, NDArray[np.int64]]:
        """The H different states of one hand, and which of them (B,) each row has.

        Rows that differ in the other hand alone cost the same for this one, and most do.

        Args:
            side: `LEFT` or `RIGHT`.
            earliest: all frames before it are alike for keys that went down in them.
        """
        key, since, until = (each[:, side] for each in (self.key, self.since, self.until))
        since = np.maximum(since, earliest - 1)
        place = self.centre[:, side].copy().view(np.int64)[:, None]
        state = np.ascontiguousarray(np.hstack([key, since, until, place]))
        whole = state.view(np.dtype((np.void, state.itemsize * state.shape[1])))[:, 0]
        _, first, row = np.unique(whole, return_index=True, return_inverse=True)
        return Fingers(key[first], since[first], until[first], self.centre[first, side]), row

    def extend(
        self, struck: Struck, factor: NDArray[np.float64], config: FingeringConfig
    ) -> tuple[_Beam, _Choice]:
        """Try every way to play the notes struck in one frame, and keep the cheapest.

        Args:
            struck: the M notes.
            factor: (M,) of the cost of leaving each out.
            config: the costs.
        """
        options, pairs = _options_in_reach(struck.keys, config)
        hands, rows = [], []
        for side in (LEFT, RIGHT):
            strikes = _strikes(options[side], struck.keys)
            fingers, row = self._hand(side, struck.onset - config.early)
            hands.append(hand_cost(side, fingers, strikes, struck, config))
            rows.append(row)
        left, right = hands
        # (P, M): who plays each note.
        mine, other = options[LEFT][pairs[:, LEFT]], options[RIGHT][pairs[:, RIGHT]]
        assigned = np.where(mine >= 0, mine, np.where(other >= 0, other + FINGER_COUNT, -1))
        frames = np.minimum(struck.lost(struck.onset, struck.ends), config.most_frames)
        left_out = config.drop * struck.unit * factor + frames
        at_left, at_right = ((rows[side][:, None], pairs[:, side]) for side in (LEFT, RIGHT))
        apart = right.centre[at_right] - left.centre[at_left]
        total = self.cost[:, None] + (assigned < 0) @ left_out
        total += left.cost[at_left] + right.cost[at_right]
        total += config.crossed * struck.unit * (apart < config.apart)

        keep = min(config.beam, total.size)
        chosen = np.argpartition(total.ravel(), keep - 1)[:keep]
        parent, pair = np.unravel_index(chosen, total.shape)

        def both(name: str) -> NDArray[Any]:
            """(keep, 2, ...) An attribute of the chosen continuations of both hands."""
            each = [
                getattr(hand, name)[rows[side][parent], pairs[pair, side]]
                for side, hand in enumerate(hands)
            ]
            return np.stack(each, axis=1)

        assignment, let_go = assigned[pair], both("let_go")
        early, late = both("early"), both("late")
        key, since, until = self.key[parent], self.since[parent], self.until[parent]
        until = np.where(let_go, np.minimum(until, struck.onset - early[..., None]), until)
        row, note = np.nonzero(assignment >= 0)
        hand, finger = np.divmod(assignment[row, note], FINGER_COUNT)
        key[row, hand, finger] = struck.keys[note]
        since[row, hand, finger] = struck.onset + late[row, hand]
        until[row, hand, finger] = struck.ends[note]
        # All choices are kept until the end of the piece: in hours of music, bytes count.
        small = (array.astype(np.int8) for array in (assignment, early, late))
        choice = _Choice(parent.astype(np.int32), let_go, *small)
        return _Beam(total[parent, pair], key, since, until, both("centre")), choice


def _options_in_reach(
    keys: NDArray[np.int64], config: FingeringConfig
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """The options (O, M) within reach of each hand, and which pairs (P, 2) go together."""
    options, pairs = _options(len(keys))
    strikes = _strikes(options, keys)
    for side in (LEFT, RIGHT):
        reached = np.isfinite(chord_cost(side, strikes, config))
        pairs = pairs[reached[pairs[:, side]]]
    used, places = zip(
        *(np.unique(pairs[:, side], return_inverse=True) for side in (LEFT, RIGHT)), strict=True
    )
    return [options[mine] for mine in used], np.stack(places, axis=1)


def _strikes(options: NDArray[np.int64], keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """(O, 5) Key that each finger strikes in options (O, M) for M keys, `KEYS` for none."""
    strikes = np.full((len(options), FINGER_COUNT), KEYS)
    option, note = np.nonzero(options >= 0)
    strikes[option, options[option, note]] = keys[note]
    return strikes


@cache
def _options(notes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Ways to play `notes` keys struck together, low to high.

    Returns:
        options (O, notes), the finger 0..4 of one hand on each note, -1 for none; and
        pairs (P, 2), which options of the left and the right hand go together. Fingers do not
        cross, within a hand or between hands.
    """
    # Ten fingers from bass to treble: left little .. left thumb, right thumb .. right little.
    finger = np.array([4, 3, 2, 1, 0, 0, 1, 2, 3, 4])
    fewest = max(0, notes - _MOST_DROPPED.get(notes, notes))
    halves = []
    for played in sorted({*range(min(notes, 2) + 1), *range(fewest, notes + 1)}):
        which, places = (
            np.array(list(combinations(range(many), played)), np.int64)
            for many in (notes, 2 * FINGER_COUNT)
        )
        mine = np.full((len(which), len(places), 2, notes), -1)
        way = np.arange(len(which))[:, None, None], np.arange(len(places))[:, None]
        mine[*way, places // FINGER_COUNT, which[:, None]] = finger[places]
        halves.append(mine.reshape(-1, notes))
    # Options are numbered as they first occur; one number for each compares faster than a row.
    options = np.concatenate(halves)
    number = (options + 1) @ (FINGER_COUNT + 1) ** np.arange(notes)
    _, first, row = np.unique(number, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return options[first[order]], np.argsort(order)[row].reshape(-1, 2)

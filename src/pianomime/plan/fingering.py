"""Which finger of which hand plays each note: a search over onsets for both hands at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.music import Score
from pianomime.plan.fingertip_plan import LEFT, RIGHT
from pianomime.world.figures import BLACK, CONTROL_DT, key_centres

_FINGERS = 5
_MOST_DROPPED = 2
# Where the fingers of a right hand lie along the keyboard when it is at ease, thumb first [m].
_EASE = np.array([-0.062, -0.024, 0.0, 0.023, 0.046])
# How far from there each one is played without effort [m].
_SPREAD = np.array([0.022, 0.014, 0.014, 0.014, 0.018])
# And how far at most.
_REACH = np.array([0.065, 0.040, 0.040, 0.040, 0.048])


@dataclass(frozen=True)
class FingeringConfig:
    """Costs of the search; 1 is a small inconvenience."""

    beam: int = 80
    """Partial fingerings kept at each onset."""
    drop: float = 12.0
    """For a note that no finger plays, and"""
    drop_frame: float = 0.5
    """for each frame that it would have sounded, or that a held note is cut short by."""
    cut: float = 15.0
    """For a held note that is let go early, on top."""
    travel_speed: float = 0.4
    """[m/s] of a hand that costs 1 (it grows with the square)."""
    late: float = 30.0
    """For a hand that cannot be there in time, at most."""
    hop_speed: float = 0.25
    """[m/s] of a finger from key to key, relative to its hand, that costs 1."""
    reuse: float = 20.0
    """For a finger that goes straight from one key to another; less, the longer it was free."""
    thumb_on_black: float = 0.8
    weak_finger: float = 0.3
    """For ring and little finger on any note."""
    crossed: float = 3.0
    """For hands nearer than `apart`."""
    apart: float = 0.10
    """[m] between the middle fingers of the two hands."""


@dataclass(frozen=True, eq=False)
class Fingering:
    """Who plays the N notes of a score, and until when.

    Attributes:
        hand: (N,) int8; 0 left, 1 right, -1 not played.
        finger: (N,) int8; 0 thumb .. 4 little, -1 not played.
        stop: (N,) first frame in which the finger has let go; before the note's end where the
            finger or the hand is needed elsewhere.
    """

    hand: NDArray[np.int8]
    finger: NDArray[np.int8]
    stop: NDArray[np.int64]


def find_fingering(score: Score, config: FingeringConfig | None = None) -> Fingering:
    """Search the cheapest fingering, onset by onset, keeping the best partial ones.

    A note is left out where no finger can reach it, or where reaching it in time costs more
    than leaving it out. Of more than ten notes struck at once the inner ones are left out first;
    where a chord stays out of reach without two of its notes, all of it is.
    """
    config = config or FingeringConfig()
    frames = score.note_frames()
    fingering = Fingering(
        np.full(len(score), -1, np.int8), np.full(len(score), -1, np.int8), frames[:, 1].copy()
    )
    if not len(score):
        return fingering
    beam = _Beam.start()
    history = []
    onsets, event = np.unique(frames[:, 0], return_inverse=True)
    groups = np.split(np.argsort(event, kind="stable"), np.cumsum(np.bincount(event))[:-1])
    for onset, group in zip(onsets, groups, strict=True):
        # Two voices may strike the same key at once: one finger plays both.
        keys, voice = np.unique(score.key[group], return_inverse=True)
        ends = np.zeros(len(keys), np.int64)
        np.maximum.at(ends, voice, frames[group, 1])
        outer = np.ones(len(keys), bool)
        outer[_FINGERS : len(keys) - _FINGERS] = False
        beam, choice = beam.extend(int(onset), keys[outer], ends[outer], config)
        place = np.where(outer, np.cumsum(outer) - 1, -1)[voice]
        history.append((onset, group, place, choice))
    chain = []
    row = int(np.argmin(beam.cost))
    for onset, group, place, choice in reversed(history):
        chain.append((onset, group, place, choice.assignment[row], choice.let_go[row]))
        row = int(choice.parent[row])
    sounding = np.full((2, _FINGERS), -1)
    for onset, group, place, assignment, let_go in reversed(chain):
        mine = np.where(place >= 0, assignment[place], -1)
        played = group[mine >= 0]
        hand, finger = np.divmod(mine[mine >= 0], _FINGERS)
        fingering.hand[played], fingering.finger[played] = hand, finger
        let_go = let_go[:, None] & np.ones(_FINGERS, bool)
        let_go[hand, finger] = True
        cut = sounding[let_go & (sounding >= 0)]
        fingering.stop[cut] = np.minimum(fingering.stop[cut], onset)
        sounding[hand, finger] = played
    return fingering


class _Choice(NamedTuple):
    """How each of B rows of a beam came from the one before."""

    parent: NDArray[np.int64]  # (B,) the row it came from
    assignment: NDArray[np.int8]  # (B, M) 0..4 left thumb to little, 5..9 right, -1 not played
    let_go: NDArray[np.bool_]  # (B, 2) hands that let go of everything they held


@dataclass(frozen=True, eq=False)
class _Beam:
    """B partial fingerings: what each of ten fingers last played, and where the hands are."""

    cost: NDArray[np.float64]  # (B,)
    key: NDArray[np.int64]  # (B, 2, 5) last key of each finger, -1 none yet
    until: NDArray[np.int64]  # (B, 2, 5) first frame in which the finger is free again
    centre: NDArray[np.float64]  # (B, 2) [m] where the middle finger is at ease

    @staticmethod
    def start() -> _Beam:
        return _Beam(
            np.zeros(1),
            np.full((1, 2, _FINGERS), -1),
            np.zeros((1, 2, _FINGERS), np.int64),
            np.array([[-0.14, 0.14]]),
        )

    def extend(
        self,
        onset: int,
        keys: NDArray[np.int64],
        ends: NDArray[np.int64],
        config: FingeringConfig,
    ) -> tuple[_Beam, _Choice]:
        """Every way to play the notes struck at `onset`; the best few are kept."""
        options, pairs = _options(len(keys))
        left, right = (
            self._hand_cost(side, onset, keys, options, config) for side in (LEFT, RIGHT)
        )
        played = (options[pairs[:, 0]] >= 0) | (options[pairs[:, 1]] >= 0)
        dropped = ~played @ (config.drop + config.drop_frame * (ends - onset))
        total = self.cost[:, None] + left.cost[:, pairs[:, 0]] + right.cost[:, pairs[:, 1]]
        total += dropped
        apart = right.centre[:, pairs[:, 1]] - left.centre[:, pairs[:, 0]]
        total += config.crossed * (apart < config.apart)
        keep = min(config.beam, total.size)
        chosen = np.argpartition(total.ravel(), keep - 1)[:keep]
        parent, pair = np.unravel_index(chosen, total.shape)
        left_option, right_option = pairs[pair].T
        assignment = np.where(
            options[left_option] >= 0,
            options[left_option],
            np.where(options[right_option] >= 0, options[right_option] + _FINGERS, -1),
        ).astype(np.int8)
        picks = ((left, left_option), (right, right_option))
        let_go = np.stack([hand.let_go[parent, option] for hand, option in picks], axis=1)
        centre = np.stack([hand.centre[parent, option] for hand, option in picks], axis=1)
        key, until = self.key[parent].copy(), self.until[parent].copy()
        until = np.where(let_go[..., None], np.minimum(until, onset), until)
        row, note = np.nonzero(assignment >= 0)
        side, finger = np.divmod(assignment[row, note], _FINGERS)
        key[row, side, finger] = keys[note]
        until[row, side, finger] = ends[note]
        beam = _Beam(total[parent, pair], key, until, centre)
        return beam, _Choice(parent, assignment, let_go)

    def _hand_cost(
        self,
        side: int,
        onset: int,
        keys: NDArray[np.int64],
        options: NDArray[np.int64],
        config: FingeringConfig,
    ) -> _HandCost:
        """What each option costs one hand, holding what it holds or letting go of it all."""
        # (O, 5): the key each finger is to strike, -1 none.
        strikes = np.full((len(options), _FINGERS), -1)
        option, note = np.nonzero(options >= 0)
        strikes[option, options[option, note]] = keys[note]
        remaining = np.maximum(self.until[:, side] - onset, 0)
        holding = self._pose_cost(side, onset, strikes, remaining > 0, config)
        open_hand = self._pose_cost(side, onset, strikes, np.zeros_like(remaining, bool), config)
        price = np.where(remaining > 0, config.cut + config.drop_frame * remaining, 0.0)
        # A held finger that strikes another key lets go of its own in any case.
        hold_cost = holding[0] + price @ (strikes >= 0).T
        open_cost = open_hand[0] + price.sum(axis=1, keepdims=True)
        let_go = open_cost < hold_cost
        return _HandCost(
            np.where(let_go, open_cost, hold_cost),
            np.where(let_go, open_hand[1], holding[1]),
            let_go,
        )

    def _pose_cost(
        self,
        side: int,
        onset: int,
        strikes: NDArray[np.int64],
        held: NDArray[np.bool_],
        config: FingeringConfig,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Cost (B, O) of striking keys (O, 5) while holding (B, 5), and the hand's place [m]."""
        along = key_centres()[:, 1]
        ease = _EASE if side == RIGHT else -_EASE
        last, until = self.key[:, side], np.minimum(self.until[:, side], onset)
        struck = strikes >= 0
        # (B, O, 5): what each finger is on once the notes are struck.
        busy = struck[None] | held[:, None]
        at = along[np.where(struck[None], strikes[None], last[:, None])]
        count = busy.sum(axis=2)
        wish = np.where(busy, at - ease, 0.0).sum(axis=2) / np.maximum(count, 1)
        before = self.centre[:, None, side]
        centre = np.where(count > 0, wish, before)
        stray = np.where(busy, at - ease - centre[..., None], 0.0)
        cost = ((stray / _SPREAD) ** 2).sum(axis=2)
        cost[(np.abs(stray) > _REACH).any(axis=2)] = np.inf
        # Travel: the hand can leave when the last of its released fingers has come up.
        free_since = np.where(held, 0, until).max(axis=1)
        seconds = (np.maximum(onset - free_since, 0) + 1) * CONTROL_DT
        travel = np.abs(centre - before)
        effort = (travel / seconds[:, None] / config.travel_speed) ** 2
        # The first note of a hand comes late rather than never: no other suffers from it.
        most = np.where((last >= 0).any(axis=1), config.late, 0.5 * config.drop)
        cost += np.where(struck.any(axis=1), np.minimum(effort, most[:, None]), 0.0)
        # Hop: a finger that goes to another key, on top of what the hand carries it.
        idle = (onset - until + 1) * CONTROL_DT
        hops = struck[None] & (last[:, None] >= 0) & (strikes[None] != last[:, None])
        moved = np.where(
            hops,
            np.abs(along[strikes[None]] - along[last[:, None]] - (centre - before)[..., None])
            + 0.01,
            0.0,
        )
        cost += ((moved / idle[:, None] / config.hop_speed) ** 2).sum(axis=2)
        cost += (hops * config.reuse * ((CONTROL_DT / idle) ** 2)[:, None]).sum(axis=2)
        cost += config.weak_finger * struck[:, 3:].sum(axis=1)
        cost += config.thumb_on_black * (struck[:, 0] & np.take(BLACK, strikes[:, 0]))
        return cost, centre


class _HandCost(NamedTuple):
    """For each of B rows and O options: cost, where the hand then is [m], whether it let go."""

    cost: NDArray[np.float64]
    centre: NDArray[np.float64]
    let_go: NDArray[np.bool_]


@cache
def _options(notes: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Ways to play `notes` keys struck together, low to high.

    Returns:
        options (O, notes): the finger 0..4 of one hand on each note, -1 for none; and
        pairs (P, 2): which options of the left and the right hand go together. Fingers keep
        their order along the keyboard; at most two notes are left out, or all.
    """
    rows: dict[tuple[int, ...], int] = {}
    pairs = []
    # Ten fingers from bass to treble: left little .. left thumb, right thumb .. right little.
    left = [4, 3, 2, 1, 0]
    for played in sorted({0, *range(max(0, notes - _MOST_DROPPED), notes + 1)}):
        for which in combinations(range(notes), played):
            for places in combinations(range(2 * _FINGERS), played):
                mine = np.full((2, notes), -1)
                for note, place in zip(which, places, strict=True):
                    if place < _FINGERS:
                        mine[LEFT, note] = left[place]
                    else:
                        mine[RIGHT, note] = place - _FINGERS
                pairs.append([rows.setdefault(tuple(half), len(rows)) for half in mine])
    return np.array(list(rows), np.int64).reshape(-1, notes), np.array(pairs)

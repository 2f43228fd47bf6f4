"""What it costs one hand to strike some keys, given where its fingers are.

Everything is weighed by what it is expected to cost in the end: key-frames, each worth one over
the keys that should be down in its frame, for that is how much of the frame's score it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, FRAME_SECONDS, KEYS
from pianomime.plan.fingertip_plan import RIGHT
from pianomime.plan.reach import EASE, stretch
from pianomime.world.layout import FINGER_COUNT
from pianomime.world.parameters import key_centres

# [m] A finger that goes to another key, up and down again.
_LIFT = 0.01
EARLY, LATE = 4, 5
"""Choices of how many frames a hand leaves early (0 to 3), and arrives late (0 to 4)."""


@dataclass(frozen=True)
class FingeringConfig:
    """Costs of the search for a fingering, in key-frames."""

    beam: int = 80
    """Partial fingerings kept at each onset."""
    drop: float = 4.0
    """For a note that no finger plays, beside its frames."""
    cut: float = 0.5
    """For a held note that is let go early, beside the frames it loses."""
    late: float = 1.5
    """For a note that begins late, beside the frames it loses."""
    stretch: float = 4.0
    """For two fingers at the limit of their reach; it grows with the fourth power."""
    strain: float = 1.0
    """The same, but it grows with the square."""
    travel_speed: float = 0.5
    """[m/s] of a hand that costs 1 for each note it strikes (it grows with the square)."""
    hop_speed: float = 0.3
    """[m/s] of a finger from key to key, relative to its hand, that costs 1."""
    reuse: float = 4.0
    """For a finger that goes straight from one key to another; less, the longer it was free."""
    thumb_on_black: float = 0.2
    weak_finger: float = 0.1
    """For ring and little finger on any note."""
    crossed: float = 0.5
    """For hands nearer than `apart`."""
    apart: float = 0.10
    """[m] between the middle fingers of the two hands."""


class Struck(NamedTuple):
    """M keys that are struck in one frame."""

    onset: int
    keys: NDArray[np.int64]  # (M,) low to high
    ends: NDArray[np.int64]  # (M,) one past the last frame of each
    worth: NDArray[np.float64]  # (T + 1 + LATE,) of a key in all the frames before each

    @property
    def unit(self) -> float:
        """Worth of a key-frame at the onset."""
        return float(self.worth[self.onset + 1] - self.worth[self.onset])

    def lost(
        self, first: NDArray[np.int64] | int, end: NDArray[np.int64] | int
    ) -> NDArray[np.float64]:
        """Worth of a key from frame `first` up to, and without, `end`; 0 if there are none."""
        missed: NDArray[np.float64] = self.worth[np.maximum(end, first)] - self.worth[first]
        return missed


class Fingers(NamedTuple):
    """The fingers of one hand, thumb first, in each of B partial fingerings."""

    key: NDArray[np.int64]  # (B, 5) last key of each finger, -1 none yet
    since: NDArray[np.int64]  # (B, 5) frame in which it went down, -1 if none yet
    until: NDArray[np.int64]  # (B, 5) first frame in which the finger is free again
    centre: NDArray[np.float64]  # (B,) [m] where the middle finger is at ease


class HandCost(NamedTuple):
    """For each of B partial fingerings and O ways to go on."""

    cost: NDArray[np.float64]  # (B, O)
    centre: NDArray[np.float64]  # (B, O) [m] where the hand then is
    let_go: NDArray[np.bool_]  # (B, O, 5) fingers that have let go before the hand strikes
    early: NDArray[np.int64]  # (B, O) frames before the onset in which they have, at the latest
    late: NDArray[np.int64]  # (B, O) frames after the onset in which the hand strikes


def chord_cost(
    side: int, strikes: NDArray[np.int64], config: FingeringConfig
) -> NDArray[np.float64]:
    """(O,) cost [key-frames] of holding the keys (O, 5) of each finger, `KEYS` for none.

    Infinite where the hand cannot reach them all.
    """
    pair = pair_cost(side, config.strain, config.stretch)
    cost = np.zeros(len(strikes))
    for low, high in combinations(range(FINGER_COUNT), 2):
        cost += pair[low, high][strikes[:, low], strikes[:, high]]
    return cost


@cache
def pair_cost(side: int, strain: float, limit: float) -> NDArray[np.float64]:
    """(5, 5, 89, 89) cost [key-frames] of two fingers on two keys, inf out of reach."""
    share = stretch(side)
    cost: NDArray[np.float64] = strain * share**2 + limit * share**4
    return cost


def hand_cost(
    side: int,
    fingers: Fingers,
    strikes: NDArray[np.int64],
    struck: Struck,
    config: FingeringConfig,
) -> HandCost:
    """What each of O ways to strike keys costs a hand, after each of B partial fingerings.

    Args:
        side: `LEFT` or `RIGHT`.
        fingers: where the hand's fingers are.
        strikes: (O, 5) the key each finger is to strike, `KEYS` for none.
        struck: when, and what all of it is worth.
        config: the costs.
    """
    strike = strikes < KEYS
    held: NDArray[np.bool_] = fingers.until > struck.onset
    cost = struck.unit * chord_cost(side, strikes, config)[None].repeat(len(held), axis=0)

    # A held finger lets go where that costs less than holding on, or when it is to strike.
    holding = struck.unit * _holding_cost(side, strikes, np.where(held, fingers.key, KEYS), config)
    rest = struck.lost(struck.onset, fingers.until) + config.cut * struck.unit
    rest = np.where(held, rest, 0.0)[:, None]
    release = held[:, None] & (strike | (holding > rest))
    kept = held[:, None] & ~release
    cost += np.where(release, rest, np.where(kept, holding, 0.0)).sum(axis=2)

    # Where the hand then is.
    along = key_centres()[:, 1]
    ease = EASE if side == RIGHT else -EASE
    busy = strike | kept
    at = along[np.where(strike, np.minimum(strikes, KEYS - 1), fingers.key[:, None])]
    wish = np.where(busy, at - ease, 0.0).sum(axis=2) / np.maximum(busy.sum(axis=2), 1)
    before = fingers.centre[:, None]
    centre = np.where(busy.any(axis=2), wish, before)

    travel, early, late = _travel_cost(
        np.abs(centre - before), fingers, release, strikes, struck, config
    )
    cost += travel

    # A finger that goes to another key, on top of what the hand carries it.
    idle = struck.onset - np.minimum(fingers.until, struck.onset)[:, None]
    idle = np.maximum(idle, early[..., None]) + late[..., None] + 1
    hops = strike & (fingers.key[:, None] >= 0) & (strikes != fingers.key[:, None])
    way = np.abs(at - along[fingers.key][:, None] - (centre - before)[..., None]) + _LIFT
    hop = (way / (idle * FRAME_SECONDS * config.hop_speed)) ** 2 + config.reuse / idle**2
    cost += struck.unit * np.where(hops, hop, 0.0).sum(axis=2)

    thumb = np.minimum(strikes[:, 0], KEYS - 1)
    black_thumb = strike[:, 0] & np.take(BLACK, thumb)
    dislike = config.weak_finger * strike[:, 3:].sum(axis=1) + config.thumb_on_black * black_thumb
    cost += struck.unit * dislike
    some: NDArray[np.bool_] = np.any(strike, axis=1)
    let_go = np.where(some[:, None], ~kept, release)
    return HandCost(cost, centre, let_go, early, late)


def _holding_cost(
    side: int, strikes: NDArray[np.int64], holds: NDArray[np.int64], config: FingeringConfig
) -> NDArray[np.float64]:
    """(B, O, 5) cost [key-frames] of each finger holding its key (B, 5) while others strike."""
    pair = pair_cost(side, config.strain, config.stretch)
    cost = np.zeros((len(holds), len(strikes), FINGER_COUNT))
    for finger, other in permutations(range(FINGER_COUNT), 2):
        cost[..., finger] += pair[other, finger][strikes[:, other], holds[:, None, finger]]
    return cost


def _travel_cost(
    distance: NDArray[np.float64],
    fingers: Fingers,
    release: NDArray[np.bool_],
    strikes: NDArray[np.int64],
    struck: Struck,
    config: FingeringConfig,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Cost of moving the hand (B, O), and how early it leaves and late it arrives for that.

    What it leaves behind loses frames, and what it arrives at; the cheapest of all combinations
    is taken. A hand that strikes nothing has all the time in the world.
    """
    onset, unit = struck.onset, struck.unit
    notes = (strikes < KEYS).sum(axis=1)
    released = release.sum(axis=2)
    held: NDArray[np.bool_] = fingers.until > onset
    freed = np.where(held, 0, fingers.until).max(axis=1)[:, None]
    gap = onset - np.where(released, onset, freed)  # (B, O) frames that it has anyway
    early = np.arange(EARLY)[:, None, None]
    late = np.arange(LATE)

    # (EARLY, LATE, B, O)
    seconds = (np.maximum(gap, early)[:, None] + late[:, None, None] + 1) * FRAME_SECONDS
    effort = (distance / seconds / config.travel_speed) ** 2
    # The first notes of a hand come as soon as they can rather than never: no others suffer.
    first: NDArray[np.bool_] = np.all(fingers.key < 0, axis=1)[:, None]
    total = notes * unit * np.where(first, np.minimum(effort, config.drop / 2), effort)

    # Leaving early takes frames from notes that end just before, or that are let go of.
    leave = onset - early
    mine = (fingers.key >= 0) & ~held & (fingers.until > leave)
    taken = np.where(mine, struck.lost(np.maximum(leave, 0), fingers.until), 0.0)
    taken[mine & (fingers.since >= leave)] = np.inf  # nothing would be left of it
    lost = taken.sum(axis=2)[:, :, None] + released * struck.lost(np.maximum(leave, 0), onset)
    newest = np.where(release, fingers.since[:, None], -1).max(axis=2)
    lost[(released > 0) & (newest >= leave)] = np.inf
    # What the hand holds on to may itself have come late: it neither leaves before that,
    newest_kept = np.where(held[:, None] & ~release, fingers.since[:, None], -1).max(axis=2)
    lost[(early > 0) & (newest_kept >= leave)] = np.inf
    total += lost[:, None]
    # nor strikes anything else.
    total += np.where(onset + late[:, None, None] < newest_kept, np.inf, 0.0)

    # Arriving late, from all that it strikes.
    ends = np.full(KEYS + 1, onset + LATE)
    ends[struck.keys] = struck.ends
    shortest = ends[strikes].min(axis=1) - onset
    delay = struck.lost(onset, onset + late) + config.late * unit * (late > 0)
    total += np.where(late[:, None] < shortest, notes * delay[:, None], np.inf)[:, None]

    flat = total.reshape(EARLY * LATE, *distance.shape)
    best = np.where(notes > 0, flat.argmin(axis=0), 0)
    least = np.take_along_axis(flat, best[None], axis=0)[0]
    return np.where(notes > 0, least, 0.0), *np.divmod(best, LATE)

"""Cost of striking some keys with one hand, given where its fingers are.

To strike a key is to press it at the onset of a note. All costs are in key-frames, the expected
number of wrong keys summed over frames. A key-frame has the *value* 1/n where n keys should be
down in its frame, because that is its share of the frame's recall.

What counts is either frames, as in the paper's metric, or notes, as for an ear: `FingeringConfig()`
and `FingeringConfig.notes()`. Where notes count, each is worth as much in a full chord as alone,
and short as long.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, FRAME_SECONDS, KEYS
from pianomime.plan.fingertip_plan import RIGHT
from pianomime.plan.reach import EASE, stretch
from pianomime.validation import above_zero, finite, whole_numbers, within
from pianomime.world.layout import FINGER_COUNT
from pianomime.world.parameters import key_centres

_LIFT = 0.01
"""[m] Way up and down that a finger makes in addition when it changes keys."""
LATE = 5
"""A hand arrives 0 to 4 frames after an onset."""


@dataclass(frozen=True)
class FingeringConfig:
    """Costs of the fingering search, in key-frames; by default those where frames count."""

    beam: int = 80
    """Number of partial fingerings kept after each onset."""
    drop: float = 4.0
    """Cost of a note that no finger plays, in addition to its frames."""
    cut: float = 0.5
    """Cost of releasing a held note early, in addition to the frames it loses."""
    late: float = 1.5
    """Cost of a note that begins late, in addition to the frames it loses."""
    by_note: bool = False
    """Whether all costs but those of frames are the same however many keys should be down; else
    they are shared among these, as frames are."""
    melody: float = 1.0
    """Factor of the cost of a melody note that no finger plays."""
    bass: float = 1.0
    """Factor of the cost of a bass note that no finger plays."""
    frame: float = 1.0
    """Cost of a frame in which a key is missed, shared among the keys that should be down."""
    pedalled: float = 1.0
    """Factor of the cost of a frame in which the pedal is down, and a key sounds on by itself."""
    most_frames: float = 1e9
    """Greatest cost of the frames of one note that is not played, or released early."""
    early: int = 3
    """Frames before an onset at which a hand may leave the keys it holds, at most."""
    stretch: float = 4.0
    """Cost of two fingers at the limit of their reach; grows with the fourth power of the reach."""
    strain: float = 1.0
    """Cost of two fingers at the limit of their reach; grows with the square of the reach."""
    travel_speed: float = 0.5
    """Speed of a hand that costs 1 per note it strikes [m/s]; the cost grows with its square."""
    hop_speed: float = 0.3
    """Speed of a finger between two keys, relative to its hand, that costs 1 [m/s]."""
    reuse: float = 4.0
    """Cost of a finger that changes keys within one frame; falls with the square of the frames."""
    crossing: bool = True
    """Whether fingers other than the thumb may cross, as where they pass through each other."""
    thumb_on_black: float = 0.2
    """Cost of the thumb on a black key."""
    weak_finger: float = 0.1
    """Cost of the ring or the little finger on any key."""
    crossed: float = 0.5
    """Cost of hands that are closer than `apart`, or crossed."""
    apart: float = 0.10
    """Least distance from the left to the right middle finger along the keyboard [m]."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        finite(self)
        within("beam", self.beam, 1)
        within("early", self.early, 0)
        for name in ("travel_speed", "hop_speed"):
            above_zero(name, getattr(self, name))

    @classmethod
    def notes(cls) -> FingeringConfig:
        """Costs where notes count.

        An ear misses a note that is not struck, be it short or long, in a full chord or alone, and
        outer voices first; it hardly hears a long note end early.
        """
        return cls(
            beam=200,
            by_note=True,
            melody=2.5,
            bass=2.5,
            most_frames=6.0,
            late=4.0,
            travel_speed=0.35,
        )

    @classmethod
    def solid_notes(cls) -> FingeringConfig:
        """Costs where notes count and neither hands nor fingers pass through each other."""
        return replace(cls.notes(), crossing=False, crossed=3.0, apart=0.13)


class Struck(NamedTuple):
    """M keys that are struck in one frame.

    Attributes:
        onset: the frame.
        keys: (M,) the keys, low to high.
        ends: (M,) frame after the last one in which each key should be down.
        value: (T + 1 + LATE,) value of a key that is down in all frames before each.
        unit: factor of every cost but that of frames.
    """

    onset: int
    keys: NDArray[np.int64]
    ends: NDArray[np.int64]
    value: NDArray[np.float64]
    unit: float

    def lost(
        self, first: NDArray[np.int64] | int, end: NDArray[np.int64] | int
    ) -> NDArray[np.float64]:
        """Value of a key that is missed from frame `first` up to, without, `end`; at least 0."""
        missed: NDArray[np.float64] = self.value[np.maximum(end, first)] - self.value[first]
        return missed


class Fingers(NamedTuple):
    """The fingers of one hand, thumb first, in each of B partial fingerings.

    Attributes:
        key: (B, 5) last key of each finger, -1 for none yet.
        since: (B, 5) frame in which that key went down, -1 for none yet.
        until: (B, 5) first frame in which the finger is free again.
        centre: (B,) where the relaxed middle finger is along the keyboard [m].
    """

    key: NDArray[np.int64]
    since: NDArray[np.int64]
    until: NDArray[np.int64]
    centre: NDArray[np.float64]


class HandCost(NamedTuple):
    """Costs of O continuations of each of B partial fingerings, for one hand.

    Attributes:
        cost: (B, O) [key-frames].
        centre: (B, O) where the relaxed middle finger then is along the keyboard [m].
        let_go: (B, O, 5) fingers that release their key before the hand strikes.
        early: (B, O) how many frames before the onset they have released it, at the latest.
        late: (B, O) how many frames after the onset the hand strikes.
    """

    cost: NDArray[np.float64]
    centre: NDArray[np.float64]
    let_go: NDArray[np.bool_]
    early: NDArray[np.int64]
    late: NDArray[np.int64]


def chord_cost(
    side: int, strikes: NDArray[np.int64], config: FingeringConfig
) -> NDArray[np.float64]:
    """Cost of the stretch between the fingers of one hand.

    Args:
        side: `LEFT` or `RIGHT`.
        strikes: (O, 5) key of each finger, `KEYS` for none.
        config: the costs.

    Returns:
        (O,) [key-frames]; infinite where the hand cannot reach all keys.
    """
    pair = pair_cost(side, config.strain, config.stretch, config.crossing)
    cost = np.zeros(len(strikes))
    for low, high in combinations(range(FINGER_COUNT), 2):
        cost += pair[low, high][strikes[:, low], strikes[:, high]]
    return cost


@cache
def pair_cost(side: int, strain: float, limit: float, crossing: bool = True) -> NDArray[np.float64]:
    """(5, 5, 89, 89) Cost of two fingers on two keys [key-frames]; infinite out of reach.

    Args:
        side: `LEFT` or `RIGHT`.
        strain: factor of the square of the stretch.
        limit: factor of its fourth power.
        crossing: whether fingers other than the thumb may cross.
    """
    share = stretch(side, crossing)
    within_reach = np.where(np.isinf(share), 0.0, share)
    cost = strain * within_reach**2 + limit * within_reach**4
    return np.where(np.isinf(share), np.inf, cost)


def hand_cost(
    side: int,
    fingers: Fingers,
    strikes: NDArray[np.int64],
    struck: Struck,
    config: FingeringConfig,
) -> HandCost:
    """Cost of each of O ways to strike keys with one hand, after each of B partial fingerings.

    Args:
        side: `LEFT` or `RIGHT`.
        fingers: state of the hand's fingers.
        strikes: (O, 5) key that each finger strikes, `KEYS` for none.
        struck: the onset, its keys and the value of the frames.
        config: the costs.
    """
    strike = strikes < KEYS
    held: NDArray[np.bool_] = fingers.until > struck.onset
    cost = struck.unit * chord_cost(side, strikes, config)[None].repeat(len(held), axis=0)

    # A finger releases its key where holding it costs more, or where it has to strike another.
    holding = struck.unit * _holding_cost(side, strikes, np.where(held, fingers.key, KEYS), config)
    rest = np.minimum(struck.lost(struck.onset, fingers.until), config.most_frames)
    rest += config.cut * struck.unit
    rest = np.where(held, rest, 0.0)[:, None]
    release = held[:, None] & (strike | (holding > rest))
    kept = held[:, None] & ~release
    cost += np.where(release, rest, np.where(kept, holding, 0.0)).sum(axis=2)

    # The hand's new position.
    along = key_centres()[:, 1]
    ease = EASE if side == RIGHT else -EASE
    busy = strike | kept
    at = along[np.where(strike, np.minimum(strikes, KEYS - 1), fingers.key[:, None])]
    relaxed = np.where(busy, at - ease, 0.0).sum(axis=2) / np.maximum(busy.sum(axis=2), 1)
    before = fingers.centre[:, None]
    centre = np.where(busy.any(axis=2), relaxed, before)

    travel, early, late = _travel_cost(
        np.abs(centre - before), fingers, release, strikes, struck, config
    )
    cost += travel

    # Fingers that change keys, in addition to how far the hand carries them.
    idle = struck.onset - np.minimum(fingers.until, struck.onset)[:, None]
    idle = np.maximum(idle, early[..., None]) + late[..., None] + 1
    hops = strike & (fingers.key[:, None] >= 0) & (strikes != fingers.key[:, None])
    way = np.abs(at - along[fingers.key][:, None] - (centre - before)[..., None]) + _LIFT
    hop = (way / (idle * FRAME_SECONDS * config.hop_speed)) ** 2 + config.reuse / idle**2
    cost += struck.unit * np.where(hops, hop, 0.0).sum(axis=2)

    thumb = np.minimum(strikes[:, 0], KEYS - 1)
    black_thumb = strike[:, 0] & np.take(BLACK, thumb)
    awkward = config.weak_finger * strike[:, 3:].sum(axis=1) + config.thumb_on_black * black_thumb
    cost += struck.unit * awkward
    some: NDArray[np.bool_] = np.any(strike, axis=1)
    let_go = np.where(some[:, None], ~kept, release)
    return HandCost(cost, centre, let_go, early, late)


def _holding_cost(
    side: int, strikes: NDArray[np.int64], holds: NDArray[np.int64], config: FingeringConfig
) -> NDArray[np.float64]:
    """(B, O, 5) Cost [key-frames] of each finger holding its key (B, 5) while others strike."""
    pair = pair_cost(side, config.strain, config.stretch, config.crossing)
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
    """Cost of moving a hand to the keys it strikes, with the cheapest times to leave and arrive.

    Leaving early takes frames from the notes it releases, arriving late from those it strikes. A
    hand that strikes nothing moves at no cost.

    Returns:
        (B, O) cost [key-frames], frames before the onset at which the hand leaves, and frames
        after it at which the hand arrives.
    """
    onset, unit = struck.onset, struck.unit
    notes = (strikes < KEYS).sum(axis=1)
    released = release.sum(axis=2)
    held: NDArray[np.bool_] = fingers.until > onset
    freed = np.where(held, 0, fingers.until).max(axis=1)[:, None]
    gap = onset - np.where(released, onset, freed)  # (B, O) frames without a held key
    early = np.arange(config.early + 1)[:, None, None]
    late = np.arange(LATE)

    # (E, LATE, B, O)
    seconds = (np.maximum(gap, early)[:, None] + late[:, None, None] + 1) * FRAME_SECONDS
    effort = (distance / seconds / config.travel_speed) ** 2
    # A hand's first notes are not dropped for the way to them: no other notes pay for it.
    first: NDArray[np.bool_] = np.all(fingers.key < 0, axis=1)[:, None]
    total = notes * unit * np.where(first, np.minimum(effort, config.drop / 2), effort)

    # Leaving early takes frames from notes that end just before the onset, or are released.
    leave = onset - early
    mine = (fingers.key >= 0) & ~held & (fingers.until > leave)
    taken = np.where(mine, struck.lost(np.maximum(leave, 0), fingers.until), 0.0)
    taken[mine & (fingers.since >= leave)] = np.inf  # nothing of the note would be left
    lost = taken.sum(axis=2)[:, :, None] + released * struck.lost(np.maximum(leave, 0), onset)
    newest = np.where(release, fingers.since[:, None], -1).max(axis=2)
    lost[(released > 0) & (newest >= leave)] = np.inf
    # A key that the hand goes on holding may itself have been struck late: until then the hand
    # can neither leave,
    newest_kept = np.where(held[:, None] & ~release, fingers.since[:, None], -1).max(axis=2)
    lost[(early > 0) & (newest_kept >= leave)] = np.inf
    total += lost[:, None]
    # nor strike another key.
    total += np.where(onset + late[:, None, None] < newest_kept, np.inf, 0.0)

    # Arriving late takes frames from all notes that the hand strikes.
    ends = np.full(KEYS + 1, onset + LATE)
    ends[struck.keys] = struck.ends
    shortest = ends[strikes].min(axis=1) - onset
    delay = struck.lost(onset, onset + late) + config.late * unit * (late > 0)
    total += np.where(late[:, None] < shortest, notes * delay[:, None], np.inf)[:, None]

    flat = total.reshape(len(early) * LATE, *distance.shape)
    best = np.where(notes > 0, flat.argmin(axis=0), 0)
    least = np.take_along_axis(flat, best[None], axis=0)[0]
    return np.where(notes > 0, least, 0.0), *np.divmod(best, LATE)

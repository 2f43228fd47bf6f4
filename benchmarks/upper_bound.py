"""F1 of a perfect player with these two hands, which leaves out what ten fingers cannot hold.

Needs the reference data (PIANOMIME_SHARED names its folder). Every frame of the first 30 s of each
song is considered on its own, as if the hands could move there in no time, so that the result is
an upper bound. A key-frame is out of reach by

- count: there are more than ten keys to hold, or
- reach: no choice of fingers can hold them all at once. Each hand holds at most five keys, a
  finger one key, fingers in order along the keyboard, and every two fingers of a hand no further
  apart than inverse kinematics of the hand can take them (`benchmarks/reach.py`). Two numbers:
  with the fingers in the middle of their keys, and with each at the edge that suits it best (no
  finger can do more: the bound).

The largest set of keys that can be held is searched exactly. F1 is that of a player who holds it
in every frame and presses nothing else. Notes out of reach are counted at onsets: of the keys
struck in the same frame, those beyond the largest set. Beside it stands the F1 of what our own
fingering gives to fingers: how far from the bound the search for it stays.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from itertools import combinations, product
from pathlib import Path
from typing import Any

import numpy as np

import common
from pianomime.keyboard import BLACK, KEYS
from pianomime.music import Score, frame_metrics
from pianomime.music.excerpt import excerpt
from pianomime.plan.fingering import find_fingering
from pianomime.plan.fingertip_plan import FINGERS, LEFT, RIGHT
from pianomime.plan.reach import pair_limits
from pianomime.plan.zero_shot import finger_keys
from pianomime.songs.find import find_songs
from pianomime.world.parameters import key_centres, key_half_sizes

_SETS = {
    "modern": ("modern/test12", None),
    "etude12": ("etude12", None),
    "repertoire": ("repertoire", None),
    "pop": ("pop/test12", None),
    "giantmidi": ("giantmidi", 50),
}

Reach = dict[tuple[int, int, bool, bool], float]
"""How far apart [m] two fingers can be, by lower and upper finger and whether each is on black."""


def reach_of_hands() -> Reach:
    """The reach of a right hand, thumb on the bass side; that of the left is its mirror image."""
    return {
        (low, high, low_black, high_black): pair_limits(low, high, low_black, high_black)[1]
        for low, high in combinations(range(5), 2)
        for low_black, high_black in product((False, True), repeat=2)
    }


@dataclass(frozen=True)
class Hands:
    """Which keys two hands can hold together.

    Attributes:
        masks: `masks[side][low][key][high - low - 1]`: the keys above `key` that finger `high`
            can hold while `low` is on it, as bits; fingers numbered from the bass end.
    """

    masks: tuple[tuple[tuple[tuple[int, ...], ...], ...], ...]

    @classmethod
    def of(cls, reach: Reach, at_edge: bool) -> Hands:
        """Hands with fingers in the middle of their keys, or at the edges that suit them best."""
        along, half = key_centres()[:, 1], key_half_sizes()[:, 1] * at_edge
        sides = []
        for side in (LEFT, RIGHT):
            fingers = []
            for low in range(4):
                keys = []
                for key in range(KEYS):
                    row = []
                    for high in range(low + 1, 5):
                        bits = 0
                        for other in range(key + 1, KEYS):
                            pair = (low, high, bool(BLACK[key]), bool(BLACK[other]))
                            if side == LEFT:  # its little finger is at the bass end
                                pair = (4 - high, 4 - low, pair[3], pair[2])
                            apart = along[other] - along[key] - half[other] - half[key]
                            bits |= int(apart <= reach[pair]) << other
                        row.append(bits)
                    keys.append(tuple(row))
                fingers.append(tuple(keys))
            sides.append(tuple(fingers))
        return cls(tuple(sides))

    def most(self, keys: tuple[int, ...]) -> int:
        """How many of some keys, in order, two hands can hold at once."""
        best = 0
        for split in range(len(keys) + 1):
            below, above = _bits(keys[:split]), _bits(keys[split:])
            for bass in (LEFT, RIGHT):  # hands may be crossed
                if min(split, 5) + min(len(keys) - split, 5) > best:
                    best = max(best, self._one(bass, below) + self._one(1 - bass, above))
        return best

    @cache  # noqa: B019 - lives as long as the command
    def _one(self, side: int, keys: int) -> int:
        return self._from(side, 0, (keys,) * 5)

    def _from(self, side: int, finger: int, allowed: tuple[int, ...]) -> int:
        """How many keys the fingers from one on can hold, each among those allowed to it."""
        if finger == 5:
            return 0
        best = self._from(side, finger + 1, allowed[1:])
        most = 5 - finger
        for key in _indices(allowed[0]):
            if best == most:
                break
            rest = allowed[1:]
            if rest:
                within = self.masks[side][finger][key]
                rest = tuple(mine & mask for mine, mask in zip(rest, within, strict=True))
            best = max(best, 1 + self._from(side, finger + 1, rest))
        return best


def _bits(keys: tuple[int, ...]) -> int:
    return sum(1 << key for key in keys)


def _indices(bits: int) -> Iterator[int]:
    while bits:
        yield (bits & -bits).bit_length() - 1
        bits &= bits - 1


@dataclass(frozen=True)
class Bound:
    """What is out of reach in one song.

    Attributes:
        cells, notes: key-frames and notes of the score.
        over_ten: key-frames beyond ten at once.
        lost, lost_notes: key-frames and notes out of reach, by count and reach together.
        f1: of the player who holds the rest.
        planned: of one who holds what our fingering gives to fingers, when it does.
    """

    cells: int
    notes: int
    over_ten: int
    lost: int
    lost_notes: int
    f1: float
    planned: float


def bound(song: Path, hands: Hands) -> Bound:
    """The bound of one song."""
    score = excerpt(Score.from_midi(song))
    wanted = score.roll()
    held = wanted.copy()
    for frame in np.flatnonzero(wanted.any(axis=1)):
        keys = np.flatnonzero(wanted[frame])
        # Which of the keys are held makes no difference to the numbers.
        held[frame, keys[hands.most(tuple(keys.tolist())) :]] = False
    first = score.note_frames()[:, 0]
    struck = [tuple(np.unique(score.key[first == frame]).tolist()) for frame in np.unique(first)]
    count = wanted.sum(axis=1)
    planned = np.zeros_like(wanted)
    fingers = finger_keys(score, find_fingering(score))
    frame, hand, finger = np.nonzero(fingers >= 0)
    planned[frame, fingers[frame, hand, finger]] = True
    return Bound(
        cells=int(count.sum()),
        notes=sum(map(len, struck)),
        over_ten=int(np.maximum(count - 10, 0).sum()),
        lost=int((wanted & ~held).sum()),
        lost_notes=sum(len(keys) - hands.most(keys) for keys in struck),
        f1=frame_metrics(wanted, held).f1,
        planned=frame_metrics(wanted, planned).f1,
    )


def main() -> None:
    arguments = common.parser("upper_bound", __doc__).parse_args()
    data = common.shared() / "data"
    facts = common.machine()
    common.show_machine(facts)
    reach = reach_of_hands()
    print("How far apart two fingers of a hand can hold keys [mm]:\n")
    spans = _spans(reach)
    common.table(["fingers", "both white", "white, black", "black, white", "both black"], spans)
    print()
    middle, edge = (Hands.of(reach, at_edge) for at_edge in (False, True))
    rows, songs = [], {}
    with ProcessPoolExecutor(len(common.cores())) as pool:
        for name, (folder, most) in _SETS.items():
            files = find_songs([data / folder])[:most]
            careful = list(pool.map(partial(bound, hands=middle), files))
            bounds = list(pool.map(partial(bound, hands=edge), files))
            rows.append(_row(name, careful, bounds))
            songs[name] = {
                file.stem: {"middle": vars(one), "edge": vars(other)}
                for file, one, other in zip(files, careful, bounds, strict=True)
            }
    common.table(
        [
            "set", "songs", "keys beyond ten %", "key-frames out of reach %, middle", "edge",
            "notes out of reach %, middle", "edge", "F1 at most, middle", "edge", "lowest, edge",
            "F1 of our fingering",
        ],
        rows,
    )  # fmt: skip
    common.report(arguments.output, facts, {"reach_mm": spans, "rows": rows, "songs": songs})


def _spans(reach: Reach) -> list[list[Any]]:
    return [
        [
            f"{FINGERS[low]}, {FINGERS[high]}",
            *(round(1000 * reach[low, high, *on]) for on in product((False, True), repeat=2)),
        ]
        for low, high in combinations(range(5), 2)
    ]


def _row(name: str, middle: list[Bound], edge: list[Bound]) -> list[Any]:
    cells, notes = sum(song.cells for song in edge), sum(song.notes for song in edge)

    def percent(part: int, whole: int) -> float:
        return round(100 * part / whole, 3)

    both = (middle, edge)
    return [
        name,
        len(edge),
        percent(sum(song.over_ten for song in edge), cells),
        *(percent(sum(song.lost for song in songs), cells) for songs in both),
        *(percent(sum(song.lost_notes for song in songs), notes) for songs in both),
        *(round(float(np.mean([song.f1 for song in songs])), 4) for songs in both),
        round(min(song.f1 for song in edge), 4),
        round(float(np.mean([song.planned for song in edge])), 4),
    ]


if __name__ == "__main__":
    main()

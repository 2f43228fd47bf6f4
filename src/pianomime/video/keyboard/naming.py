"""Naming of keys: which octave a keyboard in a picture is in, and whether the picture is mirrored.

The black keys repeat every octave, and look the same in a mirror. What differs is where the
keyboard ends: a naming is likely if there are keys where it says so and none beyond the ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.video.keyboard.evidence import KeyEvidence
from pianomime.video.keyboard.geometry import LEFT_EDGE, WHITE_WIDTH, WHITES
from pianomime.video.keyboard.plane import Plane

_OCTAVE = 7
_C1 = 2
"""Index of the lowest C among the white keys."""
_MIRROR = 3.0
"""How much better a mirrored naming must be: films are hardly ever mirrored."""
_END = float(np.log(_OCTAVE))
"""For an end of the keyboard where the keys cease: by chance it would be any key of an octave."""
_BEYOND = 1.5
"""Most that all places beyond one end of what is seen say against keys: a sleeve, a lamp or a title
may hide as many keys as it likes."""
_MIDDLE = 0.005
"""For each white key by which the middle of what is seen is off the middle of the keyboard."""
_TURN = 49
"""In a mirror, edge n of the white keys is where edge 49 - n was, in some octave."""
_SIZES = ((0, len(WHITES), 0.0), (9, 36, float(np.log(22 / 2))))
"""First white key and number of white keys of a whole keyboard and of 61 keys, C2 to C7, and how
much rarer that is: 2 of the 22 films that we looked at show one."""


@dataclass(frozen=True)
class Naming:
    """A way to name the keys of a keyboard.

    Attributes:
        shift: white keys to add to the number of each: whole octaves.
        mirrored: whether the order is turned round first.
        score: how well it explains the picture, as the logarithm of odds.
    """

    shift: int
    mirrored: bool
    score: float

    def apply(self, plane: Plane) -> Plane:
        """The plane of the same picture in which the keys are named so."""
        sign = -1.0 if self.mirrored else 1.0
        # World y of edge n is LEFT_EDGE + WHITE_WIDTH * n.
        moved = LEFT_EDGE * (1 - sign) + WHITE_WIDTH * (self.shift + _TURN * self.mirrored)
        return Plane(np.array([[1, 0, 0], [0, sign, moved], [0, 0, 1.0]]) @ plane.matrix)

    def renamed(self, whites: NDArray[np.int64]) -> NDArray[np.int64]:
        """(N,) New numbers, ascending, of white keys (N,), ascending."""
        return self.shift + (_TURN - 1 - whites[::-1] if self.mirrored else whites)

    def lowest_c(self, evidence: KeyEvidence) -> int | None:
        """Octave of the lowest C that is seen, 4 for the middle C; None if none is."""
        whites = evidence.first + np.flatnonzero(evidence.odds() > 0)
        named = self.renamed(whites)
        named = named[(named >= 0) & (named < len(WHITES)) & (named % _OCTAVE == _C1)]
        return None if not len(named) else 1 + (int(named.min()) - _C1) // _OCTAVE


def namings(evidence: KeyEvidence) -> list[Naming]:
    """The ways to name the keys, the best first.

    Args:
        evidence: keys at places numbered in a plane in which any octave is assumed.
    """
    odds = _fair(evidence.odds())
    total = np.concatenate(([0.0], np.cumsum(odds)))
    keys = np.flatnonzero(odds > 0) + evidence.first + 0.5
    if not len(keys):
        return []
    middle = float(keys.mean())
    most = 2 + int(np.abs(keys).max()) // _OCTAVE + len(WHITES) // _OCTAVE
    best: dict[tuple[int, bool], float] = {}
    for lowest, count, rare in _SIZES:
        for mirrored in (False, True):
            for octaves in range(-most, most + 1):
                shift = _OCTAVE * octaves
                low = _TURN + shift - lowest - count if mirrored else lowest - shift
                ends = (low - evidence.first, low + count - evidence.first)
                at, end = (int(np.clip(edge, 0, len(odds))) for edge in ends)
                score = 2 * (total[end] - total[at]) - total[-1] - rare - _MIRROR * mirrored
                for inner, outer in ((at, at - 1), (end - 1, end)):
                    inside = min(inner, outer) >= 0 and max(inner, outer) < len(odds)
                    if inside and odds[inner] > 1 and odds[outer] < 0:
                        score += _END
                if 0 <= ends[0] < len(odds):
                    score += evidence.bare[ends[0], 0]
                if 0 < ends[1] <= len(odds):
                    score += evidence.bare[ends[1] - 1, 1]
                named = shift + (_TURN - middle if mirrored else middle)
                score -= _MIDDLE * abs(named - len(WHITES) / 2)
                way = (shift, mirrored)
                best[way] = max(best.get(way, -np.inf), float(score))
    ways = [Naming(shift, mirrored, score) for (shift, mirrored), score in best.items()]
    return sorted(ways, key=lambda way: -way.score)


def _fair(odds: NDArray[np.float64]) -> NDArray[np.float64]:
    """(P,) The odds of keys at places (P,), with less weight on many places beyond an end."""
    keys = np.flatnonzero((odds[1:] > 1) & (odds[:-1] > 1))
    if not len(keys):
        return odds
    fair = odds.copy()
    for beyond in (slice(0, int(keys[0])), slice(int(keys[-1]) + 2, len(odds))):
        against = -float(np.minimum(odds[beyond], 0.0).sum())
        if against > _BEYOND:
            fair[beyond] = np.minimum(fair[beyond], 0.0) * _BEYOND / against
    return fair

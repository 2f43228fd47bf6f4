"""Matching of the notes of two scores, one to one and on the same key."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

from pianomime.music.score import MAX_SECONDS, Score
from pianomime.short_repr import short_repr

_DECIMALS = 4


def rounded(seconds: ArrayLike) -> Any:
    """Differences of times to 0.1 ms [s], as mir_eval compares them with a tolerance.

    So a difference of exactly the tolerance is a match, whatever binary fractions make of it.

    Args:
        seconds: any shape [s].
    """
    return np.round(np.asarray(seconds, np.float64), _DECIMALS)


@dataclass(frozen=True, eq=False)
class Candidates:
    """All pairs of a wanted and a played note on one key whose onsets are near each other.

    Attributes:
        wanted: (C,) index of the wanted note of each pair.
        played: (C,) index of the played note.
        late: (C,) how much later the played one begins [s], to 0.1 ms.
        shape: numbers of all wanted and of all played notes.
    """

    wanted: NDArray[np.int64]
    played: NDArray[np.int64]
    late: NDArray[np.float64]
    shape: tuple[int, int]

    __repr__ = short_repr

    @classmethod
    def of(cls, wanted: Score, played: Score, tolerance: float) -> Candidates:
        """The pairs of two scores.

        Args:
            wanted: what was to be played.
            played: what was played.
            tolerance: greatest difference of the onsets [s].
        """
        # One line of time for all keys, on which no window reaches from one key to the next.
        apart = MAX_SECONDS + 1 + 2 * tolerance
        line = played.key * apart + played.onset
        order = np.argsort(line, kind="stable")
        at, slack = wanted.key * apart + wanted.onset, tolerance + 10.0**-_DECIMALS
        first, stop = (np.searchsorted(line[order], at + side * slack) for side in (-1, 1))
        count = stop - first
        index = np.repeat(np.arange(len(wanted)), count)
        begins = np.repeat(np.cumsum(count) - count, count)
        other = order[np.repeat(first, count) + np.arange(count.sum()) - begins]
        late = rounded(played.onset[other] - wanted.onset[index])
        made = cls(index, other, late, (len(wanted), len(played)))
        return made.where(np.abs(late) <= tolerance)

    def where(self, fits: NDArray[np.bool_]) -> Candidates:
        """Those pairs that fit.

        Args:
            fits: (C,) bool.
        """
        return Candidates(self.wanted[fits], self.played[fits], self.late[fits], self.shape)

    def offsets_fit(
        self, wanted: Score, played: Score, share: float, least: float
    ) -> NDArray[np.bool_]:
        """(C,) Whether the offsets of a pair are near each other, as mir_eval has it.

        Args:
            wanted: the score of the wanted notes.
            played: that of the played ones.
            share: greatest difference, as a share of the wanted note's length.
            least: which is not less than this [s].
        """
        one, other = wanted.offset[self.wanted], played.offset[self.played]
        length = one - wanted.onset[self.wanted]
        return np.asarray(rounded(np.abs(other - one)) <= np.maximum(share * length, least))

    def most(self) -> int:
        """Size of the largest one-to-one matching."""
        graph = coo_array((np.ones(len(self.late), bool), (self.wanted, self.played)), self.shape)
        if not graph.nnz:
            return 0
        return int((maximum_bipartite_matching(graph.tocsr()) >= 0).sum())

    def nearest(self) -> Candidates:
        """The largest one-to-one matching; of several, that with the least sum of |late|.

        Returns:
            Its pairs, in the order of the wanted notes.
        """
        if not len(self.late):
            return self
        wanted_count, played_count = self.shape
        nodes = wanted_count + played_count
        graph = coo_array(
            (np.ones(len(self.late), bool), (self.wanted, wanted_count + self.played)),
            (nodes, nodes),
        )
        part = connected_components(graph, directed=False)[1][self.wanted]
        order = np.argsort(part, kind="stable")
        bounds = np.flatnonzero(np.diff(part[order])) + 1
        chosen = [self._nearest_of(pairs) for pairs in np.split(order, bounds)]
        pairs = np.concatenate(chosen)
        pairs = pairs[np.argsort(self.wanted[pairs])]
        return Candidates(self.wanted[pairs], self.played[pairs], self.late[pairs], self.shape)

    def _nearest_of(self, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those of the pairs of one connected part that are matched."""
        if len(pairs) == 1:
            return pairs
        row = np.unique(self.wanted[pairs], return_inverse=True)[1]
        column = np.unique(self.played[pairs], return_inverse=True)[1]
        shape = row.max() + 1, column.max() + 1
        error = np.abs(self.late[pairs])
        # To leave a pair out costs more than all errors together, so that the matching is largest.
        cost = np.full(shape, 1.0 + min(shape) * error.max())
        cost[row, column] = error
        pair_at = np.full(shape, -1)
        pair_at[row, column] = pairs
        matched = pair_at[linear_sum_assignment(cost)]
        return np.asarray(matched[matched >= 0])

"""What an ear minds: notes that are missed, that nobody wanted, late or with another touch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan.strikes import Strikes
from pianomime.track.heard import Frame, Strike
from pianomime.validation import above_zero, finite
from pianomime.world.touch import Touch

_OPEN = 0.05
"""[s] After its onset, until which a strike that did not come may still do so."""
_AHEAD = 0.03
"""[s] Strikes so near the end of what is looked at are not missed yet."""


@dataclass(frozen=True)
class NoteCostConfig:
    """Costs, of which a missed inner note is the unit."""

    outer: float = 1.5
    """Cost of a note of the melody or the bass that is not struck."""
    phantom: float = 1.2
    """Cost of a strike that nobody wanted."""
    late: float = 0.3
    """Cost of a strike that is 48 ms early or late, in proportion above 8 ms up to 68 ms."""
    touch: float = 0.15
    """Cost of a velocity that is 16 steps off, in proportion above 4 steps up to 22 steps."""
    frame: float = 0.1
    """Cost of a key that is wrong at the end of a frame."""
    notice: float = 0.15
    """Costs of time and touch of a strike, together, above which it is among what goes wrong."""
    match: float = 0.12
    """A strike further than this from the onset is another one [s]."""

    def __post_init__(self) -> None:
        finite(self)
        above_zero("match", self.match)


class NoteCost:
    """The cost of what is heard, given what was heard before.

    Args:
        strikes: what should be heard.
        goal: (T, 88) bool, the keys that should be down at the end of each frame.
        touch: the map from the speed of a key to velocity.
        config: costs.
    """

    short = 0.01

    def __init__(
        self, strikes: Strikes, goal: NDArray[np.bool_], touch: Touch, config: NoteCostConfig
    ) -> None:
        self._goal, self._touch, self._config = goal, touch, config
        self._onset: list[float] = strikes.onset.tolist()
        self._key: list[int] = strikes.key.tolist()
        self._velocity: list[int] = strikes.velocity.tolist()
        self._missed = np.where(strikes.outer, config.outer, 1.0).tolist()
        self._of_key: dict[int, list[int]] = {}
        for strike, key in enumerate(self._key):
            self._of_key.setdefault(key, []).append(strike)
        self._done: set[int] = set()

    def heard(self, strikes: Sequence[Strike]) -> None:
        """Remember what has sounded for good; later strikes cannot be those notes again."""
        for strike in strikes:
            wanted = self._wanted(strike, self._done)
            if wanted is not None:
                self._done.add(wanted)

    def of(
        self, first: int, frames: Sequence[Frame], count: int
    ) -> tuple[float, list[tuple[int, int]]]:
        """As `Cost.of`.

        What goes wrong are notes that are missed, strikes that nobody wanted, and those that are
        more off than `notice`. Keys that are wrong at the end of a frame, and nothing else, are not
        among it.
        """
        tally = self.tally(first)
        for step, frame in enumerate(frames):
            tally.add(frame, counts=step < count)
        return tally.total(), tally.wrong + [
            (min(max(step, 0), len(frames) - 1), key) for step, key in tally.missed()
        ]

    def tally(self, first: int) -> NoteTally:
        """The cost of frames that are added one after the other.

        Args:
            first: number of the first frame.
        """
        return NoteTally(self, first)

    def _wanted(self, strike: Strike, done: set[int]) -> int | None:
        """The strike that this one is: the nearest of its key that has not come yet."""
        open_ones = [
            (abs(self._onset[wanted] - strike.time), wanted)
            for wanted in self._of_key.get(strike.key, ())
            if wanted not in done
        ]
        apart, wanted = min(open_ones, default=(math.inf, -1))
        return wanted if apart < self._config.match else None

    def _off(self, strike: Strike, wanted: int) -> float:
        """The cost of time and touch."""
        late = max(abs(strike.time - self._onset[wanted]) - 0.008, 0.0) / 0.04
        velocity = int(self._touch.velocity_of(strike.speed, strike.key))
        steps = max(abs(velocity - self._velocity[wanted]) - 4, 0) / 12
        return self._config.late * min(late, 1.5) + self._config.touch * min(steps, 1.5)

    def _open(self, first: int, end: float, done: set[int]) -> list[int]:
        """Strikes that have not come, with onsets from a frame on, but before `end` [s]."""
        begin = first * FRAME_SECONDS - _OPEN
        between = np.searchsorted(self._onset, [begin, end])
        return [wanted for wanted in range(*between.tolist()) if wanted not in done]


class NoteTally:
    """The cost of some frames, as they are heard.

    Attributes:
        wrong: what went wrong so far but for notes that are missed, as of `NoteCost.of`.

    Args:
        cost: of what is heard, given what was heard before.
        first: number of the first frame.
    """

    def __init__(self, cost: NoteCost, first: int) -> None:
        self._of, self._first, self._frames, self._heard = cost, first, 0, 0.0
        self._done = set(cost._done)
        self.wrong: list[tuple[int, int]] = []

    def add(self, frame: Frame, counts: bool = True) -> None:
        """What is heard in the next frame.

        Args:
            frame: that follows those before.
            counts: whether it costs; else it only shows what still comes.
        """
        cost, config, step = self._of, self._of._config, self._frames
        for strike in frame.strikes:
            wanted = cost._wanted(strike, self._done)
            if wanted is not None:
                self._done.add(wanted)
            if not counts:
                continue
            each = config.phantom if wanted is None else cost._off(strike, wanted)
            self._heard += each
            if wanted is None or each > config.notice:
                self.wrong.append((step, strike.key))
        if counts:
            self._heard += config.frame * float(
                (frame.pressed != cost._goal[self._first + step]).sum()
            )
            self._frames += 1

    @property
    def least(self) -> float:
        """What it costs at least, whatever is heard after it."""
        past = (self._first + self._frames) * FRAME_SECONDS - self._of._config.match
        return self._heard + sum(self._missing(past))

    def total(self) -> float:
        """What it costs if nothing is heard after it."""
        cost = self._heard
        for each in self._missing(self._end):
            cost += each
        return cost

    def missed(self) -> list[tuple[int, int]]:
        """Notes that are missed, as frames counted from the first, and keys."""
        cost = self._of
        return [
            (int(cost._onset[wanted] / FRAME_SECONDS) - self._first, cost._key[wanted])
            for wanted in cost._open(self._first, self._end, self._done)
        ]

    @property
    def _end(self) -> float:
        """[s] Strikes that have not come until then are missed."""
        return (self._first + self._frames) * FRAME_SECONDS - _AHEAD

    def _missing(self, end: float) -> list[float]:
        """The costs of strikes that should have come before [s]."""
        missing = self._of._open(self._first, end, self._done)
        return [self._of._missed[wanted] for wanted in missing]

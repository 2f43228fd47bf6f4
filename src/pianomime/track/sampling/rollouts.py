"""Roll-outs of controls, from which the best are taken; what has lost is not rolled out.

The cost of a roll-out only grows. As soon as it exceeds that of the best known, the roll-out ends,
which changes nothing but the time it takes. Where one hand alone is varied, and the other is far
from it, only that hand is simulated, and the keys of the other do what they are known to do. Where
hands pass through each other it may be near: it is simulated by itself, once.
Controls may be rolled out in perturbed copies of the world, too; what has lost in it is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS, KEYS
from pianomime.track.heard import Frame, Strike, strikes_in
from pianomime.track.sampling.cost import Cost
from pianomime.world import World, WorldBatch
from pianomime.world.hand import hand_points
from pianomime.world.one_hand import one_hand_model, state_of_one_hand
from pianomime.world.parameters import key_centres
from pianomime.world.perturbation import Perturbation

_BROKEN = 100.0
"""Cost of physics that breaks."""
_ROUNDING = 1e-9
"""A cost that is greater by more than this is greater in whatever order it is summed."""


class Outcome(NamedTuple):
    """Controls (H, S, 46) of H frames, what they cost, and what is heard with them."""

    ctrl: NDArray[np.float64]
    cost: float
    heard: list[Frame]


class _OtherHand(NamedTuple):
    """What a hand did in a frame, and how far down (88,) each key was at its end, 0..1."""

    frame: Frame
    key_state: NDArray[np.float64]


class Start(NamedTuple):
    """Whence controls are rolled out.

    Attributes:
        first: number of the first frame.
        batch: of the worlds that are simulated.
        state: (S,) of each of them.
        sounding: (88,) bool: keys that sound.
        mine: (88,) bool: keys that are simulated; the others do what is known.
        known: what is known of each frame.
        alone: whether one hand alone is simulated.
        other: what the other hand does to the keys in each frame, where it is simulated by itself.
    """

    first: int
    batch: WorldBatch
    state: NDArray[np.float64]
    sounding: NDArray[np.bool_]
    mine: NDArray[np.bool_]
    known: Sequence[Frame]
    alone: bool
    other: Sequence[_OtherHand] | None = None


class Rollouts:
    """Rolls out controls side by side.

    Attributes:
        steps: frames that were simulated so far.
        alone: of these, frames in which one hand alone was simulated.

    Args:
        cost: of what is heard.
        goal: (T, 88) bool, the keys that should be down at the end of each frame.
        most: number of controls that are rolled out side by side.
        threads: how many step at the same time; 0 for one on each core.
        world: name of the world.
        perturbation: how it differs; not at all if None.
    """

    def __init__(
        self,
        cost: Cost,
        goal: NDArray[np.bool_],
        most: int,
        threads: int,
        world: str,
        perturbation: Perturbation | None = None,
    ) -> None:
        self._cost, self._goal, self._world = cost, goal, world
        self.steps = self.alone = 0

        def batch(model: str | mujoco.MjModel) -> WorldBatch:
            given = model if perturbation is None else perturbation.model(model)
            return WorldBatch(most, threads, quiet=True, model=given)

        self._batch = batch(world)
        # Made when first needed: many pieces never need them.
        self._of_hand = cache(lambda hand: batch(one_hand_model(hand, world)))

    def start(self, first: int, world: World, known: Sequence[Frame]) -> Start:
        """Both hands, as they are in a world.

        Args:
            first: number of the first frame.
            world: as it is before it.
            known: what is known of the frames.
        """
        every = np.ones(KEYS, bool)
        return Start(first, self._batch, world.state(), world.sounding, every, known, False)

    def start_alone(self, start: Start, hand: int, keys: NDArray[np.bool_]) -> Start:
        """One hand alone, where both are known.

        Args:
            start: of both hands.
            hand: 0 left, 1 right.
            keys: (88,) bool: those that it may touch.
        """
        state = state_of_one_hand(start.state, hand, self._world)
        return start._replace(batch=self._of_hand(hand), state=state, mine=keys, alone=True)

    def start_beside(self, start: Start, hand: int, ctrl: NDArray[np.float64]) -> Start:
        """One hand alone, however near the other one is, in a world in which they do not collide.

        The other hand is simulated by itself once; a key is as far down as the hand that presses it
        further has it.

        Args:
            start: of both hands.
            hand: 0 left, 1 right.
            ctrl: (H, S, 46) controls, of which those of the other hand are followed.
        """
        other = self.start_alone(start, 1 - hand, start.mine)
        first, left = np.zeros(1, np.int64), other.batch
        left.set_state(other.state, first)
        left.sounding[first] = start.sounding
        seen = []
        for step, target in enumerate(ctrl):
            left.step(target[None], ids=first)
            (frame,) = self._frames(other, step, first)
            seen.append(_OtherHand(frame, left.key_state[0].copy()))
        self.steps += len(ctrl)
        self.alone += len(ctrl)
        return self.start_alone(start, hand, start.mine)._replace(other=seen)

    def best(
        self,
        start: Start,
        tries: NDArray[np.float64],
        known: Outcome | None = None,
        copies: Sequence[tuple[Rollouts, Start]] = (),
    ) -> Outcome:
        """The outcome that costs least; of several, the first, and `known` before all.

        Args:
            start: whence.
            tries: (B, H, S, 46) controls.
            known: the best known from there.
            copies: roll-outs in perturbed copies of the world, each with whence there; the mean of
                what controls cost in them is added.
        """
        bound = known.cost if known else math.inf
        found = self._outcomes(start, tries, np.full(len(tries), bound))
        for rollouts, there in copies:
            # What is left of the bound, as a cost in this copy.
            rest = np.full(len(tries), -math.inf)
            for index, one in found.items():
                rest[index] = (bound - one.cost) * len(copies)
            there_too = rollouts._outcomes(there, tries, rest)
            found = {
                index: found[index]._replace(cost=found[index].cost + one.cost / len(copies))
                for index, one in there_too.items()
            }
        outcomes = found.values()
        return min([known, *outcomes] if known else outcomes, key=lambda each: each.cost)

    def _outcomes(
        self, start: Start, tries: NDArray[np.float64], bounds: NDArray[np.float64]
    ) -> dict[int, Outcome]:
        """Outcomes, by index, of controls that cost no more than their bounds (B,).

        Those whose bound is negative are not rolled out.
        """
        first, batch = start.first, start.batch
        left = np.flatnonzero(bounds >= -_ROUNDING)
        batch.set_state(start.state, left)
        batch.sounding[left] = start.sounding
        tallies = [self._cost.tally(first) for _ in tries]
        played: list[list[Frame]] = [[] for _ in tries]
        short = np.zeros(len(tries))
        for step in range(tries.shape[1]):
            if not len(left):
                break
            batch.step(tries[left, step], ids=left)
            self.steps += len(left)
            self.alone += len(left) * start.alone
            down = batch.key_state[left]
            if start.other is not None:
                down = np.maximum(down, start.other[step].key_state)
            away = np.abs(down - self._goal[first + step])
            short[left] += self._cost.short * np.where(start.mine, away, 0.0).sum(axis=1)
            for index, frame in zip(left, self._frames(start, step, left), strict=True):
                played[index].append(frame)
                tallies[index].add(frame)
            sure = np.array([tallies[index].least for index in left])
            sure += short[left] + _BROKEN * batch.blow_ups[left]
            left = left[sure <= bounds[left] + _ROUNDING]
        costs = {
            index: short[index] + tallies[index].total() + _BROKEN * batch.blow_ups[index]
            for index in left.tolist()
        }
        return {
            index: Outcome(tries[index], float(cost), played[index])
            for index, cost in costs.items()
        }

    def _frames(self, start: Start, step: int, left: NDArray[np.int64]) -> list[Frame]:
        """What is heard in a frame of each of some worlds."""
        known, pressed, events = start.known[step], start.batch.pressed, start.batch.key_events
        others = [strike for strike in known.strikes if not start.mine[strike.key]]
        if start.other is not None:
            beside = start.other[step].frame
            others, pressed = beside.strikes, pressed | beside.pressed
        heard: dict[int, list[Strike]] = {}
        begin = (start.first + step) * FRAME_SECONDS
        for index in np.unique(events.world).tolist():
            strikes = strikes_in(events, begin, index)
            heard[index] = [strike for strike in strikes if start.mine[strike.key]]
        return [
            Frame(
                heard.get(index, []) + others, np.where(start.mine, pressed[index], known.pressed)
            )
            for index in left.tolist()
        ]


def keys_of(hand: int, hands: NDArray[np.float64], apart: float) -> NDArray[np.bool_] | None:
    """(88,) The keys that a hand may touch; None where the other one is too near to tell.

    Args:
        hand: 0 left, 1 right.
        hands: (H, 54) joint positions of both hands in some frames [rad, m].
        apart: least distance between the fingertips of one hand and of the other, along the
            keyboard, whenever they are there [m].
    """
    along = hand_points(hands)[:, :, 1:, 1]
    left, right = along[:, 0].max(), along[:, 1].min()
    if right - left < apart:
        return None
    low: NDArray[np.bool_] = key_centres()[:, 1] < (left + right) / 2
    return low if hand == 0 else ~low

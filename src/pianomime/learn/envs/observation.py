"""The observation: named terms, concatenated to one row of numbers (paper, table 4)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import KEYS
from pianomime.learn.envs.config import ObservationConfig
from pianomime.learn.envs.state import EnvState
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT, POINTS_SIZE, TIPS_SIZE
from pianomime.world.model import SIDES

_CENTRE = np.array([0.03, 0.0, 0.03])
_EXTENT = np.array([0.15, 0.6, 0.06])
"""[m] Centre and half the extent of the space in which fingertips are; wrists are a little
beyond."""
_VELOCITY_UNIT = 10.0
"""[rad/s, m/s] Velocities are divided by this."""
_ERROR_UNIT = 0.05
"""[m] Distances from targets are divided by this."""


@dataclass(frozen=True)
class ObservationTerm:
    """A named part of the observation.

    Attributes:
        name: unique among the terms of an environment.
        func: from the state of n environments to the numbers (n, size), already scaled.
        size: how many numbers it has.
        unit: of the quantity before it is scaled.
        scaling: how `func` scales it.
    """

    name: str
    func: Callable[[EnvState], NDArray[np.generic]]
    size: int
    unit: str = ""
    scaling: str = "none"

    def __post_init__(self) -> None:
        if not self.name:
            raise InputError("an observation term needs a name")
        if self.size < 1:
            raise InputError(
                f"observation term {self.name!r}: size must be 1 or more, not {self.size}"
            )


def default_observation_terms(config: ObservationConfig) -> tuple[ObservationTerm, ...]:
    """The terms that a config switches on, in the order in which they are concatenated."""
    terms: list[ObservationTerm] = []

    def add(
        name: str,
        func: Callable[[EnvState], NDArray[np.generic]],
        size: int,
        unit: str,
        scaling: str = "none",
    ) -> None:
        if getattr(config, name):
            terms.append(ObservationTerm(name, func, size, unit, scaling))

    joints, velocity = LAYOUT.hands_size, f"divided by {_VELOCITY_UNIT:g}"
    goal, fingertips = config.goal, config.fingertips
    add("joints", _joints, joints, "rad, m", "joint limits to -1 .. 1")
    add("velocities", _velocities, joints, "rad/s, m/s", velocity)
    add("keys", _keys, KEYS, "share of the way down")
    add("goal", partial(_goal, count=goal), KEYS * goal, "0 or 1")
    add(
        "fingertips",
        partial(_fingertips, count=fingertips),
        POINTS_SIZE * fingertips,
        "m",
        "the keyboard's space to -1 .. 1",
    )
    add("base_control", _base_control, LAYOUT.ctrl_size, "rad, m", "control ranges to -1 .. 1")
    add("pedal", _pedal, 1, "0 or 1")
    add("errors", _errors, TIPS_SIZE, "m", f"divided by {_ERROR_UNIT:g}")
    add("time", _time, 1, "share of the song")
    return tuple(terms)


class Observer:
    """Writes the values of observation terms side by side into rows of numbers.

    Attributes:
        terms: in the order in which they are concatenated.
        size: numbers in an observation.
        slices: where each term is in an observation, by name.

    Args:
        terms: of the observation.

    Raises:
        InputError: two terms have the same name, or there are none.
    """

    def __init__(self, terms: Sequence[ObservationTerm]) -> None:
        self.terms = tuple(terms)
        if not self.terms:
            raise InputError("a policy needs at least one observation term")
        ends = np.cumsum([0, *(term.size for term in self.terms)]).tolist()
        self.size = int(ends[-1])
        self.slices = {
            term.name: slice(first, end)
            for term, first, end in zip(self.terms, ends, ends[1:], strict=False)
        }
        if len(self.slices) < len(self.terms):
            names = ", ".join(term.name for term in self.terms)
            raise InputError(f"observation terms must have different names, not {names}")

    def write(self, rows: NDArray[np.float32], ids: NDArray[np.int64], state: EnvState) -> None:
        """Write the observations of n environments.

        Args:
            rows: (B, size) where to.
            ids: (n,) which rows.
            state: of the n environments, before the next frame.

        Raises:
            ValueError: a term gives numbers of another shape than it says.
        """
        for term, where in zip(self.terms, self.slices.values(), strict=True):
            values = term.func(state)
            if values.shape != (len(ids), term.size):
                raise ValueError(
                    f"observation term {term.name!r} must have the shape "
                    f"{(len(ids), term.size)}, not {values.shape}"
                )
            rows[ids, where] = values


def control_range() -> NDArray[np.float64]:
    """(46,) width of each actuator's control range, right hand then left [rad, m]; a copy."""
    low, high = _limits("ctrl_low", "ctrl_high")
    return high - low


@cache
def _limits(low: str, high: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Limits of the joints or of the actuators of both hands, right then left."""
    hands = [Hand(side) for side in reversed(SIDES)]
    return (
        np.concatenate([getattr(hand, low) for hand in hands]),
        np.concatenate([getattr(hand, high) for hand in hands]),
    )


def _scaled(values: NDArray[np.float64], low: str, high: str) -> NDArray[np.float64]:
    """Values brought from their limits to -1..1."""
    least, most = _limits(low, high)
    scaled: NDArray[np.float64] = (values - (least + most) / 2) / ((most - least) / 2)
    return scaled


def _joints(state: EnvState) -> NDArray[np.float64]:
    return _scaled(state.joints, "low", "high")


def _velocities(state: EnvState) -> NDArray[np.float64]:
    return state.velocities / _VELOCITY_UNIT


def _keys(state: EnvState) -> NDArray[np.float64]:
    return state.key_state


def _goal(state: EnvState, count: int) -> NDArray[np.bool_]:
    return state.goals_ahead(count).reshape(len(state), -1)


def _fingertips(state: EnvState, count: int) -> NDArray[np.float64]:
    scaled: NDArray[np.float64] = (state.targets_ahead(count) - _CENTRE) / _EXTENT
    return scaled.reshape(len(state), -1)


def _base_control(state: EnvState) -> NDArray[np.float64]:
    return _scaled(state.base_control, "ctrl_low", "ctrl_high")


def _pedal(state: EnvState) -> NDArray[np.bool_]:
    return state.pedal[:, None]


def _errors(state: EnvState) -> NDArray[np.float64]:
    errors: NDArray[np.float64] = (state.targets - state.tips) / _ERROR_UNIT
    return errors.reshape(len(state), -1)


def _time(state: EnvState) -> NDArray[np.float64]:
    share: NDArray[np.float64] = state.frames / len(state.reference)
    return share[:, None]

"""Rehearsal: a plan is played before it is played, and every strike is corrected by what was heard.

Iterative learning control (Arimoto, Kawamura and Miyazaki, "Bettering operation of robots by
learning", 1984) of the two numbers of a strike: when it is aimed at, and how fast. The simulation
repeats itself exactly, so what is late once is late again, unless it is aimed at earlier.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.plan import FingertipPlan
from pianomime.plan.strikes import Strikes
from pianomime.progress import Steps
from pianomime.track.heard import Strike, strikes_in
from pianomime.track.keystroke import KeystrokeController
from pianomime.track.strokes import Corrections
from pianomime.validation import above_zero, finite, whole_numbers, within
from pianomime.world import World

_LEAST_SPEED = 0.03
"""[m/s] Slower strikes are corrected as if they were so fast."""


@dataclass(frozen=True)
class RehearsalConfig:
    """How a plan is rehearsed."""

    passes: int = 2
    """How often it is played before."""
    time: float = 0.7
    """Share of a strike's error of time that is corrected after each."""
    touch: float = 0.7
    """Share of its error of speed, as a ratio."""
    match: float = 0.15
    """A strike further than this from the onset is another one [s]."""
    most: float = 0.06
    """Most that a strike is aimed at earlier or later [s]."""
    slowest: float = 0.6
    """Least factor of its speed."""
    fastest: float = 1.7
    """Greatest factor of its speed."""

    def __post_init__(self) -> None:
        whole_numbers(self)
        finite(self)
        within("passes", self.passes, 0)
        for name in ("match", "slowest"):
            above_zero(name, getattr(self, name))
        within("slowest", self.slowest, 0, 1)
        within("fastest", self.fastest, 1)


class KeystrokeStarter(Protocol):
    """A tracker that makes keystroke controllers."""

    def start(self, plan: FingertipPlan) -> KeystrokeController:
        """As `Tracker.start`."""
        ...


class RehearsedTracker:
    """Follows plans as the keystroke tracker does, after playing them for itself.

    Args:
        tracker: whose strikes to correct.
        config: how.
    """

    def __init__(self, tracker: KeystrokeStarter, config: RehearsalConfig | None = None) -> None:
        self.config = config or RehearsalConfig()
        self._tracker = tracker

    def start(self, plan: FingertipPlan) -> KeystrokeController:
        """A controller whose strikes are corrected."""
        controller = self._tracker.start(plan)
        each = len(plan) + controller.correction_steps
        steps = Steps("rehearsal", self.config.passes * each)
        for _ in range(self.config.passes):
            heard = _listen(controller, steps)
            controller.correct(
                corrected(
                    controller.corrections,
                    controller.strikes,
                    controller.speeds,
                    heard,
                    self.config,
                ),
                steps.advance,
            )
        return controller


def corrected(
    before: Corrections,
    strikes: Strikes,
    speeds: NDArray[np.float64],
    heard: list[Strike],
    config: RehearsalConfig,
) -> Corrections:
    """Corrections of strikes by what was heard of them; those that were not heard stay.

    Args:
        before: with which it was played.
        strikes: (M) what should be heard.
        speeds: (M,) and how fast each key should be [m/s].
        heard: what sounded.
        config: how strikes are corrected.
    """
    advance, speed = before.advance.copy(), before.speed.copy()
    of_key: dict[int, list[Strike]] = {}
    for strike in heard:
        of_key.setdefault(strike.key, []).append(strike)
    for index, key in enumerate(strikes.key.tolist()):
        onset = strikes.onset[index]
        near = min(of_key.get(key, ()), key=lambda one: abs(one.time - onset), default=None)
        if near is None or abs(near.time - onset) > config.match:
            continue
        of_key[key].remove(near)
        advance[index] += config.time * (near.time - onset)
        speed[index] *= (speeds[index] / max(near.speed, _LEAST_SPEED)) ** config.touch
    return Corrections(
        advance.clip(-config.most, config.most), speed.clip(config.slowest, config.fastest)
    )


def _listen(controller: KeystrokeController, steps: Steps) -> list[Strike]:
    """All that sounds when a controller plays in a world of its own."""
    world, heard = World(controller.world, quiet=True), []
    parts = controller.controls_per_frame
    for frame in range(len(controller.plan)):
        for part in range(parts):
            world.step(controller.control(frame * parts + part, world), parts=parts)
            heard += strikes_in(world.key_events, (frame + part / parts) * FRAME_SECONDS)
        steps.advance(1)
    return heard

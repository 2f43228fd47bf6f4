"""Strokes: how a fingertip moves and presses so that its key sounds when and as it is to.

The finger rests just over its key and then goes down with a constant acceleration, as pianists do
who play from the key (Goebl, Bresin and Galembo 2005 call it a pressed touch): so the key is as
fast as wanted where it sounds. It goes on at that speed until the key is at its stop, where a
constant force holds it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pianomime.plan.strikes import Strikes
from pianomime.short_repr import short_repr
from pianomime.validation import above_zero, finite, one_of, within
from pianomime.world.key_sensor import sounds_at
from pianomime.world.layout import FINGER_COUNT
from pianomime.world.parameters import PARAMETERS, key_levers, key_travel
from pianomime.world.touch import DEFAULT_TOUCH, TOUCHES

_EVEN = 64
"""MIDI velocity of notes that are all struck alike."""
_TIGHT = 0.01
"""[s] After the onset, in which the path of the finger is as exact as before it."""


@dataclass(frozen=True)
class StrokeConfig:
    """The shape of a stroke."""

    touch: str = DEFAULT_TOUCH
    """Name of the map from MIDI velocity to the speed of a key, as in `world.touch.TOUCHES`."""
    even: bool = False
    """Whether all notes are struck alike, with a velocity of 64, whatever the score says."""
    settle: float = 0.03
    """Time for which the finger is over its key before the stroke begins [s]."""
    gap: float = 0.0005
    """Height over the key at which it then is, and from which the way down is counted [m]."""
    longest: float = 0.1
    """Longest stroke from its beginning to the sound: that of the softest notes [s]."""
    shortest: float = 0.02
    """Shortest stroke [s]."""
    depth: float = 0.014
    """Way of the fingertip from `gap` to where it aims at the end of the stroke, further down than
    any key goes [m]."""
    mass: float = 0.12
    """Mass of key and finger that the stroke accelerates, at the fingertip [kg]."""
    force: float = 4.0
    """Force that holds a key at its stop [N]."""
    ramp: float = 0.01
    """Time in which that force builds up after the onset [s]."""
    rise: float = 0.02
    """Time in which the finger leaves the key [s]."""
    lift: float = 0.009
    """Height over the key to which it then rises [m]."""

    def __post_init__(self) -> None:
        finite(self)
        for name in ("longest", "shortest", "ramp", "rise"):
            above_zero(name, getattr(self, name))
        within("shortest", self.shortest, 0, self.longest)
        one_of("touch", self.touch, list(TOUCHES))

    def velocities(self, strikes: Strikes) -> NDArray[np.int64]:
        """(M,) MIDI velocity with which each is to sound, 1 to 127."""
        return np.full(len(strikes), _EVEN) if self.even else strikes.velocity

    def speeds(self, strikes: Strikes) -> NDArray[np.float64]:
        """(M,) Speed of each key's front edge at which it is to sound [m/s]."""
        return TOUCHES[self.touch].speed_of(self.velocities(strikes), strikes.key)


@dataclass(frozen=True, eq=False)
class Corrections:
    """What rehearsing has taught, for each of M strikes.

    Attributes:
        advance: (M,) how much earlier than wanted it is aimed at [s].
        speed: (M,) factor of the speed that is aimed at.
    """

    advance: NDArray[np.float64]
    speed: NDArray[np.float64]

    __repr__ = short_repr

    @classmethod
    def none(cls, strikes: int) -> Corrections:
        """Those of strikes that have not been rehearsed."""
        return cls(np.zeros(strikes), np.ones(strikes))


@dataclass(frozen=True, eq=False)
class Strokes:
    """The strokes of all fingers at n points in time, which are `dt` apart.

    Attributes:
        strike: (n, 2, 5) index of the strike that each finger makes, -1 for none; hands (left,
            right), fingers thumb first.
        height: (n, 2, 5) height of its fingertip over the resting key, less than 0 below it [m];
            0 where it makes none.
        force: (n, 2, 5) with which it pushes down [N].
        tight: (n, 2, 5) bool: the stroke itself, whose motion must be exact.
    """

    strike: NDArray[np.int64]
    height: NDArray[np.float64]
    force: NDArray[np.float64]
    tight: NDArray[np.bool_]

    __repr__ = short_repr


def strokes_of(
    strikes: Strikes,
    corrections: Corrections,
    reach: NDArray[np.float64],
    times: NDArray[np.float64],
    config: StrokeConfig,
) -> Strokes:
    """The strokes of M strikes.

    Args:
        strikes: what is to be heard.
        corrections: of each.
        reach: (M,) distance of the fingertip from the hinge of its key [m].
        times: (n,) ends of the controls, equally far apart [s].
        config: shape of the strokes.
    """
    shape = (len(times), 2, FINGER_COUNT)
    made = Strokes(np.full(shape, -1), np.zeros(shape), np.zeros(shape), np.zeros(shape, bool))
    dt = times[0]
    joint = PARAMETERS["keyboard"]["joint"]
    travel = key_travel()[strikes.key]
    sounds, stop = sounds_at()[strikes.key] * reach, travel * reach
    front = config.speeds(strikes) * corrections.speed
    slowest, fastest = 2 * sounds / config.longest, 2 * sounds / config.shortest
    speed = np.clip(front * reach / key_levers()[strikes.key], slowest, fastest)
    lasts = 2 * sounds / speed
    onset = strikes.onset - corrections.advance
    first = np.rint((onset - lasts - config.settle) / dt).clip(0).astype(int)
    last = np.rint((strikes.release + config.rise) / dt).clip(0, len(times)).astype(int)
    # Of two strikes of a finger, the later begins when it begins.
    for m in range(len(strikes)):
        here = slice(first[m], last[m])
        time = times[here]
        if not len(time):
            continue
        since = (time - onset[m] + lasts[m]).clip(0)
        before = time < onset[m]
        acceleration = speed[m] / lasts[m]
        depth = np.where(
            before, acceleration * since**2 / 2, sounds[m] + speed[m] * (time - onset[m])
        ).clip(0, config.depth)
        moving = np.where(before, acceleration * since, speed[m]) * (depth < stop[m])
        # What the key's spring, damper and mass resist.
        angle = np.minimum(depth / reach[m], travel[m])
        resists = joint["stiffness"] * (angle - joint["springref"]) / reach[m]
        resists += joint["damping"] * moving / reach[m] ** 2
        resists += config.mass * acceleration * before
        holding = ((time - onset[m]) / config.ramp).clip(0, 1)
        force = (resists * (1 - holding) + config.force * holding) * (since > 0)
        left = time > strikes.release[m]
        stays = ((strikes.release[m] + config.rise - time) / config.rise).clip(0, 1)
        up = (config.gap - depth) * stays + config.lift * (1 - stays)
        place = (here, strikes.hand[m], strikes.finger[m])
        made.strike[place] = m
        made.height[place] = np.where(left, up, config.gap - depth)
        made.force[place] = np.where(left, 0.0, force)
        made.tight[place] = (since > 0) & (time < onset[m] + _TIGHT)
    return made

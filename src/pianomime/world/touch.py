"""Touch: how fast a key goes down where its note sounds, and the MIDI velocity that it stands for.

The simulated piano has keys and no hammers, so the speed of the hammer is estimated from the key's.
Speeds are those of the key's front edge [m/s], which is `key_levers()` from its hinge.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import KEYS
from pianomime.world.parameters import key_levers

SOFTEST, LOUDEST = 1, 127
"""MIDI velocities of a note that sounds; 0 would end it."""


class Touch(Protocol):
    """A map from the speed of a key to MIDI velocity, and back. Both grow with one another."""

    def velocity_of(self, speed: ArrayLike, key: ArrayLike) -> NDArray[np.int64]:
        """MIDI velocities of strikes.

        Args:
            speed: of the key's front edge where its note sounds, down is positive [m/s].
            key: 0..87. Both may be arrays that broadcast to one shape.

        Returns:
            Integers 1..127 of that shape; what is slower or faster than the map's ends gets these.

        Raises:
            ValueError: a speed is not finite, or a key is none.
        """
        ...

    def speed_of(self, velocity: ArrayLike, key: ArrayLike) -> NDArray[np.float64]:
        """Speeds of the front edge [m/s] at which a strike has these velocities.

        Args:
            velocity: 1..127.
            key: 0..87. Both may be arrays that broadcast to one shape.

        Returns:
            Array of that shape: the middle of the speeds that `velocity_of` rounds to the velocity.

        Raises:
            ValueError: a velocity is outside 1..127, or a key is none.
        """
        ...


@dataclass(frozen=True)
class HammerTouch:
    """Velocity grows with the logarithm of the speed of the hammer, as in Goebl's measurements.

    The map from the hammer's speed is that of W. Goebl's doctoral thesis (The Role of Timing and
    Intensity in the Production and Perception of Melody in Expressive Piano Performance, Graz
    2003, equation 3.2), chosen there for a Boesendorfer SE290: MIDI velocity = 52 + 25 log2(m/s).
    On the same scale, W. Goebl and R. Bresin (Measurement and reproduction accuracy of
    computer-controlled grand pianos, J. Acoust. Soc. Am. 114, 2003) give 2 m/s as 77; W. Goebl,
    R. Bresin and A. Galembo (Touch and temporal behavior of grand piano actions, ibid. 118, 2005)
    give 0.7 to 1.25 m/s as 40 to 60. They measured hammers of 0.18 to 6.8 m/s; by this map 1 is
    0.24 m/s and 127 is 8 m/s. It is a convention of an instrument and no law of nature: the speeds
    of these papers differ by 14 % from one to the other.

    That the hammer is five times as fast as the key is from A. Askenfelt and E. Jansson (From touch
    to string vibrations, Five Lectures on the Acoustics of the Piano, Stockholm 1990): key fronts
    of 0.3 to 0.5 m/s in mezzo forte and up to 1 m/s in forte, hammers of up to 5 m/s. That the
    ratio is the same for every key, and at every speed, is our choice.

    Attributes:
        hammer_ratio: speed of the hammer over that of the key's front edge.
        at_one: MIDI velocity of a hammer of 1 m/s.
        per_octave: MIDI velocity by which a hammer of twice the speed is louder.
    """

    hammer_ratio: float = 5.0
    at_one: float = 52.0
    per_octave: float = 25.0

    def __post_init__(self) -> None:
        """Refuse a map that does not grow.

        Raises:
            ValueError: a ratio is not positive.
        """
        if not (self.hammer_ratio > 0 and self.per_octave > 0):
            raise ValueError("hammer_ratio and per_octave must be positive")

    def velocity_of(self, speed: ArrayLike, key: ArrayLike) -> NDArray[np.int64]:
        """As `Touch.velocity_of`."""
        speed, _ = _speeds(speed, key)
        # A key that barely moves is as soft as can be, and has no logarithm.
        hammer = np.maximum(speed * self.hammer_ratio, np.finfo(np.float64).tiny)
        return _rounded(self.at_one + self.per_octave * np.log2(hammer))

    def speed_of(self, velocity: ArrayLike, key: ArrayLike) -> NDArray[np.float64]:
        """As `Touch.speed_of`."""
        velocity, _ = _velocities(velocity, key)
        return np.exp2((velocity - self.at_one) / self.per_octave) / self.hammer_ratio


@dataclass(frozen=True)
class AngularTouch:
    """Velocity grows linearly with the angular speed of the key.

    The range is that of CANTABILE (arXiv 2609.18213), so that numbers compare: 0.39 to 8 rad/s are
    MIDI 1 to 127. That it is linear between these ends is our reading.

    Attributes:
        slowest, fastest: angular speeds of the softest and of the loudest note [rad/s].
    """

    slowest: float = 0.39
    fastest: float = 8.0

    def __post_init__(self) -> None:
        """Refuse a map that does not grow.

        Raises:
            ValueError: the ends are not 0 <= slowest < fastest.
        """
        if not 0 <= self.slowest < self.fastest:
            raise ValueError("the ends must be 0 <= slowest < fastest")

    def velocity_of(self, speed: ArrayLike, key: ArrayLike) -> NDArray[np.int64]:
        """As `Touch.velocity_of`."""
        speed, lever = _speeds(speed, key)
        share = (speed / lever - self.slowest) / (self.fastest - self.slowest)
        return _rounded(SOFTEST + (LOUDEST - SOFTEST) * share)

    def speed_of(self, velocity: ArrayLike, key: ArrayLike) -> NDArray[np.float64]:
        """As `Touch.speed_of`."""
        velocity, lever = _velocities(velocity, key)
        share = (velocity - SOFTEST) / (LOUDEST - SOFTEST)
        return (self.slowest + (self.fastest - self.slowest) * share) * lever


TOUCHES: dict[str, Touch] = {"goebl-bresin": HammerTouch(), "cantabile": AngularTouch()}
"""The maps by name."""
DEFAULT_TOUCH = "goebl-bresin"
"""What players aim at and are heard with, unless told otherwise."""


def _speeds(speed: ArrayLike, key: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Speeds and the levers of their keys, of one shape."""
    speeds, levers = np.broadcast_arrays(np.asarray(speed, np.float64), _levers(key))
    if not np.isfinite(speeds).all():
        raise ValueError("speeds of keys must be finite")
    return speeds, levers


def _velocities(
    velocity: ArrayLike, key: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Velocities and the levers of their keys, of one shape."""
    velocities, levers = np.broadcast_arrays(np.asarray(velocity, np.float64), _levers(key))
    if not ((velocities >= SOFTEST) & (velocities <= LOUDEST)).all():
        raise ValueError(f"velocities must be {SOFTEST}..{LOUDEST}")
    return velocities, levers


def _levers(key: ArrayLike) -> NDArray[np.float64]:
    keys = np.asarray(key)
    if not ((keys >= 0) & (keys < KEYS)).all():
        raise ValueError(f"keys must be 0..{KEYS - 1}")
    levers: NDArray[np.float64] = key_levers()[keys]
    return levers


def _rounded(velocity: NDArray[np.float64]) -> NDArray[np.int64]:
    return np.rint(np.clip(velocity, SOFTEST, LOUDEST)).astype(np.int64)

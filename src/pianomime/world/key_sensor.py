"""What a key senses: when it sounds and falls silent between frames, and how fast it went down.

A real key sounds near the bottom of its way, and sounds again only after it has come back: in a
grand piano's double escapement until the jack is under the hammer again. Here a key sounds where
the paper counts it as pressed (0.5 degrees before its stop), and is silent, and ready to sound
again, when it has come back to half of its way, where a grand piano's damper meets the strings.
`docs/concepts/touch.md` names the sources.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.world.parameters import PARAMETERS, PHYSICS_DT, key_levers, key_travel

PRESSED_WITHIN: float = PARAMETERS["keyboard"]["pressed_within"]
"""[rad] A key this close to its stop counts as pressed (paper, section 4: 0.5 degrees)."""

_SILENT_AT = 0.5
"""Share of its way to which a key must come back to fall silent."""


class KeyEvents(NamedTuple):
    """What keys did in one step; those of a key are in the order of time.

    Attributes:
        world: (E,) index of the world; 0 in a `World`.
        key: (E,) key 0..87.
        on: (E,) bool: the key began to sound; otherwise it fell silent.
        time: (E,) when, from the beginning of the step [s].
        speed: (E,) of the key's front edge, downward, at that time [m/s].
    """

    world: NDArray[np.int64]
    key: NDArray[np.int64]
    on: NDArray[np.bool_]
    time: NDArray[np.float64]
    speed: NDArray[np.float64]

    def later(self, seconds: float) -> KeyEvents:
        """These events, so much later [s]."""
        return self._replace(time=self.time + seconds)

    def of(self, world: int) -> KeyEvents:
        """The events of one world, as of a `World`."""
        own = self.world == world
        key, on, time, speed = self.key[own], self.on[own], self.time[own], self.speed[own]
        return KeyEvents(np.zeros(len(key), np.int64), key, on, time, speed)

    def without(self, worlds: NDArray[np.int64]) -> KeyEvents:
        """These events but for those of some worlds, given by their indices (n,)."""
        kept = ~np.isin(self.world, worlds)
        return KeyEvents(
            self.world[kept], self.key[kept], self.on[kept], self.time[kept], self.speed[kept]
        )

    def followed_by(self, others: KeyEvents) -> KeyEvents:
        """These events, then others."""
        if not len(self.key) or not len(others.key):
            return self if len(self.key) else others
        return KeyEvents(
            np.append(self.world, others.world),
            np.append(self.key, others.key),
            np.append(self.on, others.on),
            np.append(self.time, others.time),
            np.append(self.speed, others.speed),
        )


@cache
def sounds_at() -> NDArray[np.float64]:
    """(88,) Angle at which each key sounds on its way down [rad]; read-only."""
    angle: NDArray[np.float64] = key_travel() - PRESSED_WITHIN
    angle.setflags(write=False)
    return angle


@cache
def silent_at() -> NDArray[np.float64]:
    """(88,) Angle at which each key falls silent on its way up [rad]; read-only."""
    angle: NDArray[np.float64] = _SILENT_AT * key_travel()
    angle.setflags(write=False)
    return angle


def sense(
    angle: NDArray[np.float64],
    velocity: NDArray[np.float64],
    sounding: NDArray[np.bool_],
) -> KeyEvents:
    """The events of one step, and `sounding` brought up to its end.

    Between two physics steps a key turns evenly, so times are interpolated. Its speed is the
    greater of those before and after: a key that meets its stop is slowed after it has sounded.

    Args:
        angle: (n + 1, B, 88) angle of each key before each of n physics steps, and at the end
            [rad].
        velocity: (n + 1, B, 88) angular velocity likewise [rad/s].
        sounding: (B, 88) bool: keys that sound at the beginning; changed in place.
    """
    on_angle, off_angle = sounds_at(), silent_at()
    before, after = angle[:-1], angle[1:]
    goes_on = (after >= on_angle) & (before < on_angle)
    goes_off = (after <= off_angle) & (before > off_angle)
    world, key, step = np.nonzero((goes_on | goes_off).transpose(1, 2, 0))
    if not len(key):
        return NOTHING
    on = goes_on[step, world, key]
    # A crossing is an event unless it leads to where the key is since the last one.
    same_key = (world[1:] == world[:-1]) & (key[1:] == key[:-1])
    first, last = np.append(True, ~same_key), np.append(~same_key, True)
    was_on = np.where(first, sounding[world, key], np.append(False, on[:-1]))
    sounding[world[last], key[last]] = on[last]
    changes = on != was_on
    world, key, step, on = world[changes], key[changes], step[changes], on[changes]
    start, end = before[step, world, key], after[step, world, key]
    share = (np.where(on, on_angle[key], off_angle[key]) - start) / (end - start)
    earlier, later = velocity[step, world, key], velocity[step + 1, world, key]
    turning = np.where(on, np.maximum(earlier, later), np.minimum(earlier, later))
    return KeyEvents(world, key, on, (step + share) * PHYSICS_DT, turning * key_levers()[key])


def as_events(events: list[tuple[int, int, bool, float, float]]) -> KeyEvents:
    """Rows of world, key, on, time and speed as `KeyEvents`."""
    world, key, on, time, speed = zip(*events, strict=True) if events else ((),) * 5
    return KeyEvents(
        np.array(world, np.int64),
        np.array(key, np.int64),
        np.array(on, bool),
        np.array(time, np.float64),
        np.array(speed, np.float64),
    )


def silenced(sounding: NDArray[np.bool_], time: float) -> KeyEvents:
    """The events of keys that fall silent because a world was put back, all at one time.

    Args:
        sounding: (B, 88) bool: keys that sound; changed in place.
        time: from the beginning of the step [s].
    """
    rows = np.argwhere(sounding).tolist()
    sounding[:] = False
    return as_events([(world, key, False, time, 0.0) for world, key in rows])


NOTHING = as_events([])
"""The events of a step in which no key did anything."""

"""What is heard: keys that began to sound, and those that are down at the end of a frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.world.key_sensor import KeyEvents


class Strike(NamedTuple):
    """A key that sounded, as opposed to `Strikes`, which are to sound.

    Attributes:
        key: 0..87.
        time: from the beginning of the plan [s].
        speed: of the key's front edge [m/s].
    """

    key: int
    time: float
    speed: float


class Frame(NamedTuple):
    """What was heard in a frame, and which keys (88,) were down at its end."""

    strikes: list[Strike]
    pressed: NDArray[np.bool_]


def strikes_in(events: KeyEvents, begin: float, world: int = 0) -> list[Strike]:
    """The keys of a world that began to sound.

    Args:
        events: of one step.
        begin: when the step began [s].
        world: index of the world.
    """
    on = events.on & (events.world == world)
    columns = (events.key[on], begin + events.time[on], events.speed[on])
    return [Strike(*row) for row in zip(*map(np.ndarray.tolist, columns), strict=True)]

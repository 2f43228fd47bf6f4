"""Calibration by touch: hands find out where the keys lie, by which of them sound.

One key is struck again and again, each time a little further to the treble. Where the finger is too
far to one side, a neighbour sounds. Comparing how often neighbours do with how often they would in
the nominal world tells by how much all keys lie aside. Nothing but the sound of keys is sensed.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_SECONDS
from pianomime.music import Score
from pianomime.plan import ZeroShotConfig, ZeroShotPlanner
from pianomime.plan.fingering_cost import FingeringConfig
from pianomime.track.heard import strikes_in
from pianomime.track.keystroke import KeystrokeTracker
from pianomime.world import World
from pianomime.world.hand import Hand
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES

_KEY = 53
"""The key that is struck: a D, which has white neighbours, away from the ends of the rails."""
_REACH = 0.02
"""[m] How far to each side it is struck: well into its neighbours, if it is where it should be."""
_STEP = 0.001
"""[m] From one strike to the next."""
_RANGE = 0.012
"""[m] How far aside keys may lie, so that neighbours on both sides are met."""
_EVERY = 0.35
"""[s] From one strike to the next: a forearm moves a millimetre and settles."""
_HELD = 0.1
"""[s] For which the key is held."""
_VELOCITY = 64
"""MIDI velocity of the strikes."""


def keys_aside(world: World, nominal: str) -> float:
    """By how much all keys of a world lie further to the treble than in the nominal one [m].

    It is found to half a millimetre, the half of what lies between two strikes, in a range of 12 mm
    to each side: beyond it the sweep ends before a neighbour is met on one side.

    Args:
        world: at rest; the calibration is played in it.
        nominal: name of the world that is known.

    Raises:
        InputError: there is no such world, or a neighbour was met on one side alone, or on none.
    """
    low, high = _neighbours(world, nominal)
    if not (low and high):
        raise InputError(
            "where the keys lie cannot be found: no key "
            f"{'below' if not low else 'above'} the one that was struck has sounded; they lie "
            f"further aside than {1000 * _RANGE:g} mm, or do not sound"
        )
    known_low, known_high = _nominal_neighbours(nominal)
    return _STEP * ((low - known_low) + (known_high - high)) / 2


def _neighbours(world: World, nominal: str) -> tuple[int, int]:
    """How many strikes sound a key below the one that is struck, and how many one above."""
    ctrl, along, offsets = _strikes(nominal)
    heard = []
    for frame, sent in enumerate(ctrl):
        strike = int(np.clip(frame * FRAME_SECONDS // _EVERY, 0, len(offsets) - 1))
        world.step(sent + offsets[strike] * along)
        heard += [(strike, one.key) for one in strikes_in(world.key_events, 0.0)]
    low = {strike for strike, key in heard if key < _KEY}
    high = {strike for strike, key in heard if key > _KEY}
    return len(low), len(high)


@cache
def _nominal_neighbours(nominal: str) -> tuple[int, int]:
    return _neighbours(World(nominal, quiet=True), nominal)


@cache
def _strikes(nominal: str) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Controls (T, S, 46) of strikes without offset; what moves the hands by 1 m (46,); offsets."""
    offsets = np.arange(-_REACH, _REACH + _STEP / 2, _STEP)
    onset = np.asarray(_EVERY * (np.arange(len(offsets)) + 0.5), np.float64)
    score = Score(
        key=np.full(len(offsets), _KEY),
        onset=onset,
        offset=onset + _HELD,
        velocity=np.full(len(offsets), _VELOCITY),
        title="calibration",
    )
    plan = ZeroShotPlanner(ZeroShotConfig(fingering=FingeringConfig.notes())).plan(score)
    controller = KeystrokeTracker(world=nominal).start(plan)
    parts, world, ctrl = controller.controls_per_frame, World(nominal, quiet=True), []
    for step in range(len(plan) * parts):
        ctrl.append(controller.control(step, world))
        world.step(ctrl[-1], parts=parts)
    along = np.zeros(LAYOUT.ctrl_size)
    for hand in (Hand(side, nominal) for side in SIDES):
        along[hand.actuators] = hand.to_ctrl @ hand_along(hand)
    return np.array(ctrl).reshape(len(plan), parts, -1), along, offsets


def hand_along(hand: Hand) -> NDArray[np.float64]:
    """(27,) Joint displacement that moves a hand 1 m toward the treble [m]."""
    _, jacobian = hand.points_and_jacobian(np.zeros(LAYOUT.hand_joints))
    along = np.zeros(LAYOUT.hand_joints)
    along[LAYOUT.slide] = 1.0 / jacobian[0, 1, LAYOUT.slide]
    return along

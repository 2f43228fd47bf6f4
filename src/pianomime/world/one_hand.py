"""One hand alone: worlds in which the other hand sleeps out of reach, at half the cost.

All arrays keep their shapes: a `World` or `WorldBatch` of such a model takes controls of both
hands, and those of the sleeping one do nothing.
"""

from __future__ import annotations

from copy import copy
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES, world_model
from pianomime.world.state import STATE
from pianomime.world_names import PAPER

_AWAY = 1.0
"""[m] Height by which the sleeping hand is lifted; nothing touches it there."""


@cache
def one_hand_model(hand: int, world: str = PAPER) -> mujoco.MjModel:
    """The model of a world in which one hand plays.

    Args:
        hand: that plays, 0 left, 1 right.
        world: its name. The model is made once; treat it as read-only.

    Raises:
        InputError: there is no such world.
    """
    model = copy(world_model(world))
    forearm = model.body(f"{SIDES[1 - hand]}_forearm").id
    model.body_pos[forearm, 2] += _AWAY
    model.tree_sleep_policy[model.body_treeid[forearm]] = int(mujoco.mjtSleepPolicy.mjSLEEP_INIT)
    return model


def state_of_one_hand(
    state: NDArray[np.float64], hand: int, world: str = PAPER
) -> NDArray[np.float64]:
    """(S,) The state of a world for the model of one hand: the other one rests, or it would wake.

    Args:
        state: (S,) as `World.state` returns it.
        hand: that plays, 0 left, 1 right.
        world: its name.
    """
    model = one_hand_model(hand, world)
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, STATE)
    joints = LAYOUT.joints[1 - hand]
    for quantity in (data.qpos, data.qvel, data.qacc_warmstart):
        quantity[joints] = 0.0
    alone = np.empty_like(state)
    mujoco.mj_getState(model, data, alone, STATE)
    return alone

"""The physics of MuJoCo Warp, as a model that MuJoCo itself simulates alike.

With it, what the GPU does otherwise can be told from errors, and measured without a GPU.
"""

from __future__ import annotations

import copy

import mujoco


def warp_physics(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy of a model, with the options that MuJoCo Warp simulates whatever the model says.

    All bodies are awake: which of them sleep is no part of a state, and could not be restored.
    Convex shapes collide by MuJoCo's native collider, the only one that Warp has.
    """
    same = copy.copy(model)
    same.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    same.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
    return same


def sparse_for_warp(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy as of `warp_physics`, with the sparse Jacobians that Warp needs at this size.

    It is for Warp alone: MuJoCo itself solves this world wrongly with them (see `world.model`).
    """
    sparse = warp_physics(model)
    sparse.opt.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    return sparse

"""Paths of both hands that keep the hands, and the fingers of each, apart.

The paths of two hands are one problem where they must not pass through each other. Each
Gauss-Newton step looks at where the hands are near themselves or each other, and adds a residual
for each such place: by how much it is nearer than it should be. The collision detection of MuJoCo
finds the places, with the geometry of the world itself; how the distance there changes with the
joints is the difference of the velocities of both bodies along the contact's normal.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.plan.joint_path import PathConfig, PathProblem, Rows
from pianomime.progress import ignore
from pianomime.world.layout import LAYOUT
from pianomime.world.model import SIDES
from pianomime.world.overlap import colliding_hands


def smooth_paths(
    problems: list[PathProblem],
    advance: Callable[[int], None] = ignore,
    guesses: list[NDArray[np.float64]] | None = None,
) -> list[NDArray[np.float64]]:
    """Optimise the joint positions of both hands at the end of each of T frames.

    Args:
        problems: (left, right) where each hand is to go, with the same config and frames.
        advance: called with a number of frames as they are done, `iterations` times 2 T in all.
        guesses: (left, right) paths (T, 27) to begin with [rad, m]; None for home poses along the
            targets.

    Returns:
        (left, right) joint positions (T + 1, 27) [rad, m]; the first row is where the hand starts.
    """
    config = problems[0].config
    paths = [
        problem.begin(guess)
        for problem, guess in zip(problems, guesses or [None] * len(problems), strict=True)
    ]
    for _ in range(config.iterations):
        rows = near(paths, config, problems[0].lasts) if config.apart else [None] * len(paths)
        paths = [
            problem.improve(path, here, advance)
            for problem, path, here in zip(problems, paths, rows, strict=True)
        ]
    return [np.vstack([problem.start, path]) for problem, path in zip(problems, paths, strict=True)]


def near(paths: list[NDArray[np.float64]], config: PathConfig, lasts: float = 1.0) -> list[Rows]:
    """Where hands, and fingers of a hand, are nearer than they should be.

    Args:
        paths: (left, right) joint positions (T, 27) [rad, m].
        config: how near they may come, and what less costs.
        lasts: length of a frame, as a share of 0.05 s.

    Returns:
        (left, right) residuals: the shortfall of each distance by the shortfall at which its cost
        is 1.
    """
    model = _wary_hands(config.apart)
    data = mujoco.MjData(model)
    scale = np.sqrt(lasts) / config.near
    poses = np.empty((len(paths[0]), LAYOUT.hands_size))
    for index, path in enumerate(paths):
        poses[:, LAYOUT.among_hands(index)] = path
    frames, shortfalls, gradients = [], [], []
    one, other = np.zeros((2, 3, LAYOUT.hands_size))
    for frame, pose in enumerate(poses):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        for contact in data.contact:
            bodies = model.geom_bodyid[contact.geom]
            mujoco.mj_jac(model, data, one, None, contact.pos, bodies[0])
            mujoco.mj_jac(model, data, other, None, contact.pos, bodies[1])
            frames.append(frame)
            shortfalls.append(contact.dist - config.apart)
            gradients.append(contact.frame[:3] @ (other - one))
    frame, residual = np.array(frames, np.int64), scale * np.array(shortfalls)
    gradient = scale * np.reshape(gradients, (-1, LAYOUT.hands_size))
    rows = []
    for index in range(len(SIDES)):
        mine = gradient[:, LAYOUT.among_hands(index)]
        moves = np.flatnonzero(mine.any(axis=1))
        rows.append(Rows(frame[moves], residual[moves], mine[moves]))
    return rows


@cache
def _wary_hands(apart: float) -> mujoco.MjModel:
    """Hands that collide as soon as they are nearer than `apart` [m]."""
    model = copy.copy(colliding_hands()[0])
    model.geom_margin[:] = apart
    return model

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

_NOWHERE = (np.zeros(0, np.int64), np.zeros(0), np.zeros((0, LAYOUT.hand_joints)))
"""Rows of hands that are apart."""


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
    begin: list[NDArray[np.float64] | None] = [None] * len(problems)
    paths = [
        problem.begin(guess)
        for problem, guess in zip(problems, guesses if guesses else begin, strict=True)
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
        is 1; half of it for each hand where two hands meet.
    """
    model, turns, moved = _wary_hands(config.apart)
    data = mujoco.MjData(model)
    poses = np.empty((len(paths[0]), LAYOUT.hands_size))
    for index, path in enumerate(paths):
        poses[:, LAYOUT.among_hands(index)] = path
    axes, anchors = np.empty((2, *poses.shape, 3))
    places = []
    for row, pose in enumerate(poses):
        data.qpos[:] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        axes[row], anchors[row] = data.xaxis, data.xanchor
        if data.ncon:
            contact = data.contact
            columns = (contact.geom, contact.dist, contact.pos, contact.frame[:, :3])
            places.append((np.full(data.ncon, row), *(np.array(column) for column in columns)))
    if not places:
        return [Rows(*_NOWHERE)] * len(SIDES)
    frame, geom, distance, point, normal = map(np.concatenate, zip(*places, strict=True))
    # Along a normal n, a hinge moves a point p by n . (axis x (p - anchor)), which is
    # axis . (p x n) + n . (anchor x axis), and a slide by n . axis.
    rests = np.where(turns[:, None], np.cross(anchors, axes), axes)
    moment = np.cross(point, normal)
    gradient = np.einsum("cjk,ck->cj", rests[frame], normal)
    gradient += np.einsum("cjk,ck->cj", axes[frame] * turns[:, None], moment)
    one, other = moved[model.geom_bodyid[geom]].swapaxes(0, 1)
    gradient *= other.astype(float) - one
    scale = np.sqrt(lasts) / config.near
    each = scale * np.stack([gradient[:, LAYOUT.among_hands(hand)] for hand in range(len(SIDES))])
    moves = each.any(axis=2)
    # Each hand gives way by half where both can.
    residual = scale * (distance - config.apart) / np.maximum(moves.sum(axis=0), 1)
    return [
        Rows(frame[some], residual[some], mine[some])
        for mine, some in zip(each, moves, strict=True)
    ]


@cache
def _wary_hands(
    apart: float,
) -> tuple[mujoco.MjModel, NDArray[np.bool_], NDArray[np.bool_]]:
    """Hands that collide as soon as they are nearer than `apart` [m].

    Returns:
        The model; (54,) which joints are hinges; (bodies, 54) which joints move each body.
    """
    model = copy.copy(colliding_hands()[0])
    model.geom_margin[:] = apart / 2  # MuJoCo adds those of both parts
    # One place for each pair of parts is enough.
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MULTICCD)
    moves = np.zeros((model.nbody, model.njnt), bool)
    for body in range(1, model.nbody):
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        moves[body] = moves[model.body_parentid[body]]
        moves[body, first : first + count] = True
    return model, model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE, moves

"""Overlap: against distances between all pairs of geoms, and against capsules by hand."""

from __future__ import annotations

import itertools
from functools import cache

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.world.layout import LAYOUT
from pianomime.world.model import build_spec, world_model
from pianomime.world.overlap import overlap

REST = np.zeros(LAYOUT.hands_size)
FINGERS = ("ff", "mf", "rf", "lf", "th")


def moved(**joints: float) -> NDArray[np.float64]:
    """The rest pose with some joints, such as rh_FFJ4, elsewhere."""
    model, pose = world_model(), REST.copy()
    for name, value in joints.items():
        pose[model.joint(name).qposadr[0] - LAYOUT.keys] = value
    return pose


def posed(pose: NDArray[np.float64]) -> mujoco.MjData:
    model = world_model()
    data = mujoco.MjData(model)
    data.qpos[LAYOUT.keys :] = pose
    mujoco.mj_kinematics(model, data)
    return data


@cache
def newer_collider() -> mujoco.MjModel:
    """The world with MuJoCo's newer collider: the older one overstates the depth of meshes."""
    spec = build_spec()
    spec.option.disableflags = 0
    return spec.compile()


def by_pairs(pose: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """The same from the signed distance of every pair of geoms in the world itself."""
    model, data = newer_collider(), posed(pose)
    bodies = [model.body(body).name for body in model.geom_bodyid]
    geoms = [geom for geom, body in enumerate(bodies) if body[:3] in ("rh_", "lh_")]
    hands, fingers = 0.0, np.zeros(2)
    for one, other in itertools.combinations(geoms, 2):
        (side, name), (its_side, its_name) = (
            (bodies[geom][:2], bodies[geom][3:]) for geom in (one, other)
        )
        both = name[:2], its_name[:2]
        palm = "lfmetacarpal" in (name, its_name)
        if side == its_side and (palm or both[0] == both[1] or not set(both) <= set(FINGERS)):
            continue
        depth = -mujoco.mj_geomDistance(model, data, one, other, 0.01, None)
        if side != its_side:
            hands = max(hands, depth)
        else:
            index = ("lh", "rh").index(side)
            fingers[index] = max(fingers[index], depth)
    return hands, fingers


def capsules(pose: NDArray[np.float64], one: str, other: str) -> float:
    """How deep two capsules overlap: their radii less the distance of their axes."""
    model, data = world_model(), posed(pose)
    axes, radii = [], 0.0
    for name in (one, other):
        geom = int(model.body(name).geomadr[0])
        assert model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CAPSULE
        radius, half, _ = model.geom_size[geom]
        along = np.linspace(-half, half, 2001)[:, None]
        axes.append(data.geom_xpos[geom] + along * data.geom_xmat[geom].reshape(3, 3)[:, 2])
        radii += radius
    first, second = axes
    apart = np.sqrt((first**2).sum(1)[:, None] + (second**2).sum(1) - 2 * first @ second.T).min()
    return float(radii - apart)


def test_hands_at_rest_touch_nothing() -> None:
    found = overlap(REST[None])
    assert not found.hands.any()
    assert not found.fingers.any()


def test_crossed_fingers_are_as_deep_as_their_capsules() -> None:
    pose = moved(rh_FFJ4=0.3, rh_MFJ4=-0.3)
    found = overlap(pose[None])
    pairs = itertools.product(("proximal", "middle"), repeat=2)
    deepest = max(capsules(pose, f"rh_ff{one}", f"rh_mf{other}") for one, other in pairs)
    assert deepest > 0.002
    assert found.fingers[0, 1] >= deepest - 1e-6
    assert found.fingers[0, 0] == found.hands[0] == 0


def test_every_pair_of_parts_counts_as_it_should() -> None:
    draw = np.random.default_rng(0)
    low, high = world_model().jnt_range[LAYOUT.keys :].T
    poses = low + (high - low) * draw.uniform(0.2, 0.8, (12, LAYOUT.hands_size))
    # Hands side by side or into each other, as they are over a keyboard.
    for hand, place in ((0, 0.15), (1, -0.15)):
        slides = LAYOUT.among_hands(hand).start + LAYOUT.slide
        poses[:, slides] = place + draw.uniform(-0.06, 0.06, len(poses))
    found = overlap(poses)
    assert (found.hands > 0.001).any()
    assert (found.fingers > 0.001).any(axis=0).all()
    for row, pose in enumerate(poses):
        hands, fingers = by_pairs(pose)
        assert found.hands[row] == pytest.approx(hands, abs=5e-4)
        assert found.fingers[row] == pytest.approx(fingers, abs=5e-4)


def test_a_pose_that_is_not_finite_has_no_depth() -> None:
    poses = np.stack([REST, REST])
    poses[1, 5] = np.nan
    found = overlap(poses)
    assert np.isnan(found.hands).tolist() == [False, True]
    assert np.isnan(found.fingers).tolist() == [[False, False], [True, True]]


def test_other_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="joints must be"):
        overlap(REST)

"""The scene of a replay: bodies, joints, shapes and cameras, read from the MuJoCo model."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import BLACK
from pianomime.replay.blocks import json_block
from pianomime.world.layout import FINGER_COUNT
from pianomime.world.model import SIDES, build_spec, fingertip_sites
from pianomime.world.parameters import key_centres, key_half_sizes
from pianomime.world.scene_look import BACKGROUND, CAMERA_VIEWS, HIDDEN_GROUP, LIGHT_VIEW, dress

_DIGITS = 6
_NUMBERED = re.compile(r"(key|lamp)_(\d+)")
_SHAPES = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
_JOINTS = {mujoco.mjtJoint.mjJNT_HINGE: "hinge", mujoco.mjtJoint.mjJNT_SLIDE: "slide"}


@cache
def scene_block() -> bytes:
    """The block of the scene. It looks the same in every world."""
    spec = build_spec()
    dress(spec)
    return json_block("SCEN", _scene(spec.compile()))


def _scene(model: mujoco.MjModel) -> dict[str, Any]:
    return {
        "bodies": [_body(model, body) for body in range(model.nbody)],
        "materials": [
            {
                "name": model.mat(material).name,
                "color": _numbers(model.mat_rgba[material, :3]),
                "specular": _number(model.mat_specular[material]),
                "shininess": _number(model.mat_shininess[material]),
            }
            for material in range(model.nmat)
        ],
        "meshes": [_mesh(model, mesh) for mesh in range(model.nmesh)],
        "geoms": [
            _geom(model, geom)
            for geom in range(model.ngeom)
            if model.geom_group[geom] < HIDDEN_GROUP
        ],
        "keys": [
            {
                "black": bool(BLACK[key]),
                "top": _numbers(centre + (0.0, 0.0, half[2])),
                "half": _numbers(half),
            }
            for key, (centre, half) in enumerate(zip(key_centres(), key_half_sizes(), strict=True))
        ],
        "fingertips": [
            _fingertip(model, hand, finger)
            for hand in range(len(SIDES))
            for finger in range(FINGER_COUNT)
        ],
        "cameras": {
            name: {
                "pos": _numbers(view.pos),
                "target": _numbers(view.target),
                "fovy": _number(view.fovy),
            }
            for name, view in CAMERA_VIEWS.items()
        },
        "light": {"pos": _numbers(LIGHT_VIEW.pos), "target": _numbers(LIGHT_VIEW.target)},
        "background": _numbers(BACKGROUND),
    }


def _body(model: mujoco.MjModel, body: int) -> dict[str, Any]:
    joints = []
    for joint in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
        index = int(model.jnt_qposadr[joint])
        joints.append(
            {
                "type": _JOINTS[mujoco.mjtJoint(model.jnt_type[joint])],
                "axis": _numbers(model.jnt_axis[joint]),
                "pos": _numbers(model.jnt_pos[joint]),
                "index": index,
                "rest": _number(model.qpos0[index]),
            }
        )
    return {
        "name": model.body(body).name,
        "parent": int(model.body_parentid[body]),
        "pos": _numbers(model.body_pos[body]),
        "quat": _numbers(model.body_quat[body]),
        "joints": joints,
    }


def _mesh(model: mujoco.MjModel, mesh: int) -> dict[str, Any]:
    vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
    return {
        "vertices": _numbers(model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]]),
        "faces": model.mesh_face[face : face + model.mesh_facenum[mesh]].ravel().tolist(),
    }


def _geom(model: mujoco.MjModel, geom: int) -> dict[str, Any]:
    name, kind = model.geom(geom).name, mujoco.mjtGeom(model.geom_type[geom])
    shape = kind.name.removeprefix("mjGEOM_").lower()
    if shape not in _SHAPES:
        raise ValueError(f"geom {name!r} is a {shape}, which a replay cannot show")
    numbered = _NUMBERED.fullmatch(name)
    key, lamp = (
        int(numbered[2]) if numbered and numbered[1] == part else -1 for part in ("key", "lamp")
    )
    return {
        "body": int(model.geom_bodyid[geom]),
        "type": shape,
        "size": _numbers(model.geom_size[geom]),
        "pos": _numbers(model.geom_pos[geom]),
        "quat": _numbers(model.geom_quat[geom]),
        "material": int(model.geom_matid[geom]),
        "mesh": int(model.geom_dataid[geom]) if shape == "mesh" else -1,
        "key": key,
        "lamp": lamp,
    }


def _fingertip(model: mujoco.MjModel, hand: int, finger: int) -> dict[str, Any]:
    # The first site of a hand is its wrist.
    site = model.site(fingertip_sites(SIDES[hand])[1 + finger]).id
    return {
        "hand": hand,
        "finger": finger,
        "body": int(model.site_bodyid[site]),
        "pos": _numbers(model.site_pos[site]),
    }


def _numbers(values: ArrayLike) -> list[float]:
    flat: NDArray[np.float64] = np.asarray(values, float).ravel()
    return [_number(value) for value in flat]


def _number(value: float) -> float:
    return round(float(value), _DIGITS)

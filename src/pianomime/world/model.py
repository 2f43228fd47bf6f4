"""The MuJoCo model of the piano and the two hands, built from `parameters.json`.

World frame: origin at the middle of the keyboard, x toward the player, y along the keyboard
(treble positive), z up; metres. Order of positions: 88 keys, then per hand (right, left)
forearm tx, ty, tz, wrist 2, wrist 1, then index to little from knuckle to tip, thumb last.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np

from pianomime.errors import unknown_name
from pianomime.keyboard import BLACK, KEYS
from pianomime.world.hand_parts import FINGER_PREFIXES as FINGER_PREFIXES
from pianomime.world.hand_parts import SIDES as SIDES
from pianomime.world.hand_parts import Side as Side
from pianomime.world.parameters import (
    PARAMETERS,
    PHYSICS_DT,
    key_centres,
    key_half_sizes,
)
from pianomime.world.solid import collide, limit
from pianomime.world_names import PAPER, SOLID, WORLDS

_GEOM_TYPES = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
}
# Keys and hands collide with each other; the two hands do not in the paper's world.
_HAND_MASK = {"contype": 1, "conaffinity": 0}
_KEY_MASK = {"contype": 0, "conaffinity": 1}
_NO_CONTACT = {"contype": 0, "conaffinity": 0}
# Bodies that are never over the keys: contacts with them need not be looked for.
_OUT_OF_REACH = ("forearm", "wrist")
_FOREARM_BASE = {"rh": (0.4, 0.15, 0.13), "lh": (0.4, -0.15, 0.13)}
_FOREARM_QUAT = (-0.5, -0.5, 0.5, 0.5)


def build_spec(world: str = PAPER) -> mujoco.MjSpec:
    """The spec of piano and both hands, with plain colours; `scene_look.dress` adds the looks.

    Args:
        world: its name, one of `WORLDS`, which the compiled model bears.

    Raises:
        InputError: there is no such world.
    """
    spec = _empty_spec(world)
    add_piano(spec)
    add_hand(spec, "rh")
    add_hand(spec, "lh")
    if world == SOLID:
        collide(spec)
        limit(spec)
    return spec


def hands_spec() -> mujoco.MjSpec:
    """The spec of both hands of the paper's world alone, in the order of `build_spec`."""
    spec = _empty_spec(PAPER)
    add_hand(spec, "rh")
    add_hand(spec, "lh")
    return spec


def world_model(world: str | mujoco.MjModel = PAPER) -> mujoco.MjModel:
    """The compiled model of a world.

    Args:
        world: its name, one of `WORLDS`; compiled once, to be treated as read-only. Or a model,
            such as a copy of one of these with other parameters, which is returned as it is.

    Raises:
        InputError: there is no such world.
    """
    return _compiled(world) if isinstance(world, str) else world


def name_of(model: mujoco.MjModel) -> str:
    """The name of the world that a model is of; copies keep it."""
    name: str = model.names[: model.names.index(b"\0")].decode()
    return name


@cache
def _compiled(world: str) -> mujoco.MjModel:
    # World itself reports broken physics; without this MuJoCo writes MUJOCO_LOG.TXT where it runs.
    log = mujoco.MjLogConfig.get()
    log.logto_file = False
    log.logto_console = False
    log.set()
    return build_spec(world).compile()


@cache
def hand_model(side: Side, world: str = PAPER) -> mujoco.MjModel:
    """The compiled model of one hand without the piano, for kinematics and inverse dynamics.

    Args:
        side: "lh" or "rh". The model is compiled once; treat it as read-only.
        world: name of the world that the hand is of; worlds differ in the dynamics alone.

    Raises:
        InputError: there is no such world.
    """
    spec = _empty_spec(world)
    add_hand(spec, side)
    if world == SOLID:
        limit(spec)
    return spec.compile()


def add_piano(spec: mujoco.MjSpec) -> None:
    """Add the 88 keys, each a hinged box, and the piano's base."""
    parameters = PARAMETERS["keyboard"]
    piano = spec.worldbody.add_body(name="piano")
    piano.add_geom(
        name="piano_base",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=parameters["base"]["pos"],
        size=parameters["base"]["half_size"],
        rgba=(0.15, 0.15, 0.15, 1.0),
        mass=0.0,
        contype=0,
        conaffinity=0,
    )
    centres, half_sizes = key_centres(), key_half_sizes()
    for key in range(KEYS):
        colour = parameters["black" if BLACK[key] else "white"]
        hinge = (-half_sizes[key, 0], 0.0, 0.0)
        body = piano.add_body(name=f"key_{key}", pos=centres[key])
        body.add_joint(
            name=f"key_{key}",
            type=mujoco.mjtJoint.mjJNT_HINGE,
            axis=(0.0, 1.0, 0.0),
            pos=hinge,
            range=colour["range"],
            limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            stiffness=_first_order(parameters["joint"]["stiffness"]),
            springref=parameters["joint"]["springref"],
            damping=_first_order(parameters["joint"]["damping"]),
            armature=parameters["joint"]["armature"],
        )
        body.add_geom(
            name=f"key_{key}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=half_sizes[key],
            mass=colour["mass"],
            rgba=(0.1, 0.1, 0.1, 1.0) if BLACK[key] else (0.95, 0.95, 0.93, 1.0),
            **parameters["contact"],
            **_KEY_MASK,
        )


def add_hand(spec: mujoco.MjSpec, side: Side) -> None:
    """Add one hand with its sliding forearm; the left one is the right one mirrored in x."""
    hand = PARAMETERS["hand"]
    mirror = -1.0 if side == "lh" else 1.0
    bodies: dict[str, mujoco.MjsBody] = {}
    for shape, vertices in PARAMETERS["fingertip_hulls"].items():
        spec.add_mesh(name=f"{side}_{shape}_tip", uservert=np.ravel(vertices))
    for parameters in hand["bodies"]:
        name = parameters["name"]
        if parameters["parent"] is None:
            parent, pos, quat = spec.worldbody, _FOREARM_BASE[side], _FOREARM_QUAT
        else:
            parent = bodies[parameters["parent"]]
            pos, quat = (
                _mirror_pos(parameters["pos"], mirror),
                _mirror_quat(parameters, "quat", mirror),
            )
        body = parent.add_body(
            name=f"{side}_{name}",
            pos=pos,
            quat=quat,
            mass=parameters["mass"],
            ipos=_mirror_pos(parameters["com"], mirror),
            iquat=_mirror_quat(parameters, "inertia_quat", mirror),
            inertia=parameters["inertia"],
            explicitinertial=True,
            gravcomp=1.0,
        )
        bodies[name] = body
        for joint in parameters["joints"]:
            _add_joint(body, joint, side, mirror)
        reaches = not name.endswith(_OUT_OF_REACH)
        for geom in parameters["geoms"]:
            _add_geom(body, geom, side, mirror, reaches)
        if "fingertip" in parameters:
            body.add_site(
                name=f"{side}_{name.removesuffix('distal')}_tip",
                pos=_mirror_pos(parameters["fingertip"], mirror),
            )
        if name == "wrist":
            body.add_site(name=f"{side}_wrist")
    for name, joints in hand["tendons"].items():
        tendon = spec.add_tendon(name=f"{side}_{name}")
        for joint in joints:
            tendon.wrap_joint(f"{side}_{joint}", 1.0)
    for actuator in hand["actuators"]:
        _add_actuator(spec, actuator, side)
    for one, other in hand["contact_excludes"]:
        spec.add_exclude(bodyname1=f"{side}_{one}", bodyname2=f"{side}_{other}")


def fingertip_sites(side: Side) -> list[str]:
    """Names of the sites of a hand's points, in plan order: wrist, thumb, index .. little."""
    return [f"{side}_wrist", *(f"{side}_{finger}_tip" for finger in FINGER_PREFIXES)]


def _empty_spec(world: str) -> mujoco.MjSpec:
    if world not in WORLDS:
        raise unknown_name("world", world, WORLDS)
    spec = mujoco.MjSpec()
    spec.modelname = world
    physics = PARAMETERS["physics"]
    spec.option.timestep = PHYSICS_DT
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    spec.option.iterations = physics["iterations"]
    spec.option.ls_iterations = physics["ls_iterations"]
    spec.option.impratio = physics["impratio"]
    spec.option.gravity = physics["gravity"]
    # Resting keys, 88 of 142 degrees of freedom, sleep until something touches them.
    spec.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    # With sparse Jacobians, MuJoCo 4.0.0 now and then solves islands wrongly: a finger that touches
    # two keys is thrown off at 1000 rad/s. Dense ones are correct, and faster here.
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    # The convex collider of MuJoCo 3.0, with which the paper's results were made.
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_MULTICCD)
    spec.compiler.degree = False
    return spec


def _add_joint(body: mujoco.MjsBody, parameters: dict[str, Any], side: Side, mirror: float) -> None:
    slide = parameters.get("type") == "slide"
    x, y, z = parameters["axis"]
    # Forearms slide along the same world axes on both sides; a mirrored hinge axis changes sign.
    axis = (x, y, z) if slide else (x, mirror * y, mirror * z)
    body.add_joint(
        name=f"{side}_{parameters['name']}",
        type=mujoco.mjtJoint.mjJNT_SLIDE if slide else mujoco.mjtJoint.mjJNT_HINGE,
        axis=axis,
        range=_range(parameters, parameters["name"], side),
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        damping=_first_order(parameters["damping"]),
        **PARAMETERS["hand"]["joint"],
    )


def _add_geom(
    body: mujoco.MjsBody, parameters: dict[str, Any], side: Side, mirror: float, reaches: bool
) -> None:
    look = {"rgba": (0.25, 0.27, 0.32, 1.0), "group": 2}
    contact = {**PARAMETERS["hand"]["contact"], **(_HAND_MASK if reaches else _NO_CONTACT)}
    if parameters["type"] == "hull":
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=f"{side}_{parameters['hull']}_tip",
            **contact,
            **look,
        )
        return
    size = [*parameters["size"], 0.0, 0.0][:3]
    body.add_geom(
        type=_GEOM_TYPES[parameters["type"]],
        size=size,
        pos=_mirror_pos(parameters["pos"], mirror),
        quat=_mirror_quat(parameters, "quat", mirror),
        **contact,
        **look,
    )


def _add_actuator(spec: mujoco.MjSpec, parameters: dict[str, Any], side: Side) -> None:
    kind = "joint" if "joint" in parameters else "tendon"
    gain = parameters["kp"]
    actuator = spec.add_actuator(
        name=f"{side}_{parameters[kind]}",
        trntype=getattr(mujoco.mjtTrn, f"mjTRN_{kind.upper()}"),
        target=f"{side}_{parameters[kind]}",
        gainprm=[gain, *[0.0] * 9],
        biasprm=[0.0, -gain, *[0.0] * 8],
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        ctrlrange=_range(parameters, parameters[kind], side),
    )
    if "force" in parameters:
        actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
        actuator.forcerange = (-parameters["force"], parameters["force"])


def _range(parameters: dict[str, Any], joint: str, side: Side) -> tuple[float, float]:
    low, high = parameters["range"]
    # tx is the same world direction on both sides, so its range is mirrored.
    return (-high, -low) if side == "lh" and joint == "forearm_tx" else (low, high)


def _mirror_pos(pos: list[float], mirror: float) -> tuple[float, float, float]:
    return (mirror * pos[0], pos[1], pos[2])


def _mirror_quat(
    parameters: dict[str, Any], name: str, mirror: float
) -> tuple[float, float, float, float]:
    w, x, y, z = parameters.get(name, (1.0, 0.0, 0.0, 0.0))
    return (w, x, mirror * y, mirror * z)


def _first_order(value: float) -> list[float]:
    """Coefficients of a linear spring or damper; MuJoCo 4 takes polynomials."""
    return [value, 0.0, 0.0]

"""URDF of a world, the format of robot descriptions in ROS: links, joints, inertia and shapes.

URDF has neither capsules, nor bodies with several joints, nor tendons. A capsule becomes a cylinder
and two spheres; each slide of a forearm but the last carries a link without mass; and that J1 and
J2 of a finger have one motor is not said: both joints are free, and have its limits.

Limits of speed are those of `Limits`: of wrists and fingers Shadow Robot's, over which the world
lets them go, of slides the world's own.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.export.limits import Limits
from pianomime.keyboard import KEYS

UNLIMITED = 1e6
"""[N m, N, rad/s, m/s] Stands for what has no limit: URDF demands a number, and 0 would be one."""
_MASSLESS = "1e-9"
"""[kg, kg m^2] What MuJoCo takes links without mass to have when it reads the file."""
_STL_HEADER = b"convex hull [m]".ljust(80)
_ROOT = "world"


def write_urdf(model: mujoco.MjModel, path: Path) -> None:
    """Write the URDF of a world, and beside it an STL file for each mesh.

    A link has its joint at its origin. For a body of a hand that is the body's frame; a key's link
    is at the hinge. Joints have the names of the model's, and so have links.

    Args:
        model: of the world.
        path: of the URDF.
    """
    robot = Xml.Element("robot", name="pianomime")
    # An extension of MuJoCo's, which other readers pass over.
    Xml.SubElement(
        Xml.SubElement(robot, "mujoco"),
        "compiler",
        fusestatic="false",
        inertiafromgeom="false",
        boundmass=_MASSLESS,
        boundinertia=_MASSLESS,
    )
    Xml.SubElement(robot, "link", name=_ROOT)
    limits = _limits(model)
    for body in range(1, model.nbody):
        for element in _joints(model, body, limits):
            robot.append(element)
        robot.append(_link(model, body))
    Xml.indent(robot)
    Xml.ElementTree(robot).write(path, "utf-8", xml_declaration=True)
    for mesh, name in enumerate(mesh_files(model)):
        (path.parent / name).write_bytes(_stl(model, mesh))


def mesh_files(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names of the STL files of a world's meshes, by the number of the mesh.

    Args:
        model: of the world.
    """
    return tuple(f"{model.mesh(mesh).name}.stl" for mesh in range(model.nmesh))


def _limits(model: mujoco.MjModel) -> dict[int, dict[str, str]]:
    """The element `limit` of each joint that a motor moves, by the joint's number in the model."""
    limits = Limits.of(model)
    effort = limits.effort[limits.joints.mover]
    pairs = enumerate(zip(effort, limits.velocity, strict=True), KEYS)
    return {
        joint: {"effort": _number(most), "velocity": _number(fastest)}
        for joint, (most, fastest) in pairs
    }


def _joints(
    model: mujoco.MjModel, body: int, limits: dict[int, dict[str, str]]
) -> Iterator[Xml.Element]:
    """The joints that lead to a body from its parent, with the links between them."""
    parent = int(model.body_parentid[body])
    name = model.body(body).name
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    above = _ROOT if parent == 0 else model.body(parent).name
    turn = _matrix(model.body_quat[body])
    place = model.body_pos[body] + turn @ _shift(model, body) - _shift(model, parent)
    if not count:
        joint = _joint(f"{name}_mount", "fixed", above, name)
        joint.append(_origin(place, turn))
        yield joint
    for joint_id in range(first, first + count):
        hinge = model.jnt_type[joint_id] == mujoco.mjtJoint.mjJNT_HINGE
        joint_name = model.joint(joint_id).name
        last = joint_id == first + count - 1
        below = name if last else f"{joint_name}_link"
        joint = _joint(joint_name, "revolute" if hinge else "prismatic", above, below)
        joint.append(_origin(place, turn))
        Xml.SubElement(joint, "axis", xyz=_numbers(model.jnt_axis[joint_id]))
        lower, upper = map(repr, model.jnt_range[joint_id].tolist())
        passive = {"effort": "0", "velocity": _number(UNLIMITED)}
        allowed = {"lower": lower, "upper": upper, **limits.get(joint_id, passive)}
        Xml.SubElement(joint, "limit", allowed)
        degree = int(model.jnt_dofadr[joint_id])
        Xml.SubElement(
            joint,
            "dynamics",
            damping=_number(model.dof_damping[degree]),
            friction=_number(model.dof_frictionloss[degree]),
        )
        yield joint
        if not last:
            yield Xml.Element("link", name=below)
        above, place, turn = below, np.zeros(3), np.eye(3)


def _joint(name: str, kind: str, parent: str, child: str) -> Xml.Element:
    joint = Xml.Element("joint", name=name, type=kind)
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
    return joint


def _shift(model: mujoco.MjModel, body: int) -> NDArray[np.float64]:
    """(3,) The origin of a body's link in the body's frame: its joint."""
    if not model.body_jntnum[body]:
        return np.zeros(3)
    anchor: NDArray[np.float64] = model.jnt_pos[model.body_jntadr[body]]
    return anchor


def _link(model: mujoco.MjModel, body: int) -> Xml.Element:
    link = Xml.Element("link", name=model.body(body).name)
    shift = _shift(model, body)
    mass = float(model.body_mass[body])
    if mass > 0.0:
        inertial = Xml.SubElement(link, "inertial")
        turn = _matrix(model.body_iquat[body])
        tensor = turn @ np.diag(model.body_inertia[body]) @ turn.T
        inertial.append(_origin(model.body_ipos[body] - shift, np.eye(3)))
        Xml.SubElement(inertial, "mass", value=repr(mass))
        entries = {
            f"i{'xyz'[row]}{'xyz'[column]}": repr(float(tensor[row, column]))
            for row in range(3)
            for column in range(row, 3)
        }
        Xml.SubElement(inertial, "inertia", entries)
    first = int(model.body_geomadr[body])
    # A world may have a shape twice, for what it collides with; here each stands once.
    seen: set[tuple[str, bytes, bytes]] = set()
    for geom in range(first, first + int(model.body_geomnum[body])):
        touches = model.geom_contype[geom] or model.geom_conaffinity[geom]
        for origin, shape in _shapes(model, geom, shift):
            for kind in ("visual", "collision") if touches else ("visual",):
                same = (kind, Xml.tostring(origin), Xml.tostring(shape))
                if same in seen:
                    continue
                seen.add(same)
                part = Xml.SubElement(link, kind)
                part.append(origin)
                Xml.SubElement(part, "geometry").append(shape)
                if kind == "visual":
                    name = f"{link.attrib['name']}_{geom}"
                    colour = _numbers(model.geom_rgba[geom])
                    material = Xml.SubElement(part, "material", name=name)
                    Xml.SubElement(material, "color", rgba=colour)
    return link


def _shapes(
    model: mujoco.MjModel, geom: int, shift: NDArray[np.float64]
) -> Iterator[tuple[Xml.Element, Xml.Element]]:
    """Origin and shape of each part that stands for a geom."""
    place, turn = model.geom_pos[geom] - shift, _matrix(model.geom_quat[geom])
    size = model.geom_size[geom]
    origin = _origin(place, turn)
    match mujoco.mjtGeom(int(model.geom_type[geom])):
        case mujoco.mjtGeom.mjGEOM_BOX:
            yield origin, Xml.Element("box", size=_numbers(2 * size))
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            yield origin, _sphere(size[0])
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            yield origin, _cylinder(size)
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            yield origin, _cylinder(size)
            for end in (-size[1], size[1]):
                yield _origin(place + end * turn[:, 2], turn), _sphere(size[0])
        case mujoco.mjtGeom.mjGEOM_MESH:
            yield origin, Xml.Element("mesh", filename=mesh_files(model)[model.geom_dataid[geom]])
        case kind:
            raise ValueError(f"URDF has no shape for a geom of type {kind.name}")


def _sphere(radius: float) -> Xml.Element:
    return Xml.Element("sphere", radius=_number(radius))


def _cylinder(size: NDArray[np.float64]) -> Xml.Element:
    return Xml.Element("cylinder", radius=_number(size[0]), length=_number(2 * size[1]))


def _origin(place: NDArray[np.float64], turn: NDArray[np.float64]) -> Xml.Element:
    """Place and rotation matrix as URDF has them: roll, pitch and yaw about fixed axes."""
    across = float(np.hypot(turn[0, 0], turn[1, 0]))
    pitch = np.arctan2(-turn[2, 0], across)
    if across > 1e-9:
        roll, yaw = np.arctan2(turn[2, 1], turn[2, 2]), np.arctan2(turn[1, 0], turn[0, 0])
    else:  # Roll and yaw turn about one axis.
        roll, yaw = np.arctan2(-turn[1, 2], turn[1, 1]), 0.0
    return Xml.Element("origin", xyz=_numbers(place), rpy=_numbers(np.array([roll, pitch, yaw])))


def _matrix(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def _stl(model: mujoco.MjModel, mesh: int) -> bytes:
    """A mesh as a binary STL file; readers compute the normals, which are 0 here."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count]
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    faces = np.zeros(count, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    faces["corners"] = vertices[model.mesh_face[first : first + count]]
    return b"".join((_STL_HEADER, count.to_bytes(4, "little"), faces.tobytes()))


def _number(value: float) -> str:
    return repr(float(min(value, UNLIMITED)))


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(map(repr, np.asarray(values, float).tolist()))

"""URDF, read by MuJoCo: the same kinematics, masses, shapes and limits."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np
import pytest

from pianomime.export import Limits, write_urdf
from pianomime.world.model import world_model
from pianomime.world_names import WORLDS


class Both(NamedTuple):
    """The world, and what MuJoCo reads in its URDF."""

    ours: mujoco.MjModel
    read: mujoco.MjModel
    path: Path

    def pose(self, positions: np.ndarray) -> tuple[mujoco.MjData, mujoco.MjData]:
        datas = mujoco.MjData(self.ours), mujoco.MjData(self.read)
        datas[0].qpos[:] = positions
        for joint in range(self.ours.njnt):
            datas[1].joint(self.ours.joint(joint).name).qpos[0] = positions[joint]
        for model, data in zip(self[:2], datas, strict=True):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
        return datas

    def bodies(self) -> list[tuple[int, int]]:
        """The number of each body in both."""
        names = [self.ours.body(body).name for body in range(1, self.ours.nbody)]
        return [(self.ours.body(name).id, self.read.body(name).id) for name in names]


@pytest.fixture(scope="module", params=WORLDS)
def both(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Both:
    path = tmp_path_factory.mktemp("urdf") / "world.urdf"
    ours = world_model(request.param)
    write_urdf(ours, path)
    return Both(ours, mujoco.MjModel.from_xml_path(str(path)), path)


def check_links(both: Both, poses: int) -> None:
    """Every link is at the joint of its body, and turned as the body, in random poses."""
    draw = np.random.default_rng(0)
    mine, its = np.array(both.bodies()).T
    hinged = both.ours.body_jntnum[mine] == 1
    joint = both.ours.body_jntadr[mine[hinged]]
    for _ in range(poses):
        ours, read = both.pose(draw.uniform(*both.ours.jnt_range.T))
        at = ours.xpos[mine]
        at[hinged] = ours.xanchor[joint]
        np.testing.assert_allclose(read.xpos[its], at, atol=1e-9)
        np.testing.assert_allclose(read.xmat[its], ours.xmat[mine], atol=1e-9)


def test_links_are_where_bodies_are(both: Both) -> None:
    check_links(both, poses=100)


def test_joints_need_not_be_at_the_origins_of_bodies(tmp_path: Path) -> None:
    ours = copy.copy(world_model())
    hinges = ours.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
    ours.jnt_pos[hinges] += np.random.default_rng(2).normal(0, 0.01, (hinges.sum(), 3))
    write_urdf(ours, tmp_path / "world.urdf")
    read = mujoco.MjModel.from_xml_path(str(tmp_path / "world.urdf"))
    check_links(Both(ours, read, tmp_path / "world.urdf"), poses=5)


def test_masses_and_inertia_are_the_same(both: Both) -> None:
    ours, read = both.pose(np.zeros(both.ours.nq))

    def tensor(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> np.ndarray:
        turn = data.ximat[body].reshape(3, 3)
        return turn @ np.diag(model.body_inertia[body]) @ turn.T

    for mine, its in both.bodies():
        mass = both.ours.body_mass[mine]
        assert both.read.body_mass[its] == pytest.approx(mass, abs=2e-9)
        if mass:
            np.testing.assert_allclose(read.xipos[its], ours.xipos[mine], atol=1e-9)
            np.testing.assert_allclose(
                tensor(both.read, read, its), tensor(both.ours, ours, mine), rtol=1e-6, atol=1e-12
            )
    assert both.read.body_mass.sum() == pytest.approx(both.ours.body_mass.sum(), abs=1e-7)


def test_joints_have_their_limits_and_damping(both: Both) -> None:
    limits = Limits.of(both.ours)
    joints = {joint.attrib["name"]: joint for joint in Xml.parse(both.path).iter("joint")}
    for joint in range(both.ours.njnt):
        name = both.ours.joint(joint).name
        its = both.read.joint(name)
        np.testing.assert_array_equal(its.range, both.ours.jnt_range[joint])
        assert its.type[0] == both.ours.jnt_type[joint]
        assert its.damping[0] == both.ours.dof_damping[joint]
        assert its.frictionloss[0] == both.ours.dof_frictionloss[joint]
        limit = joints[name].find("limit")
        assert limit is not None
        if name.startswith("key_"):
            assert limit.attrib["effort"] == "0"
            continue
        place = limits.joints.names.index(name)
        effort = min(limits.effort[limits.joints.mover[place]], 1e6)
        assert float(limit.attrib["effort"]) == effort
        assert float(limit.attrib["velocity"]) == min(limits.velocity[place], 1e6)


def test_hinges_have_shadows_speeds_not_those_of_the_world(both: Both) -> None:
    joints = {joint.attrib["name"]: joint for joint in Xml.parse(both.path).iter("joint")}
    for name, speed in (("rh_FFJ3", 2.0), ("lh_WRJ1", 2.0), ("lh_THJ5", 4.0), ("rh_THJ4", 4.0)):
        limit = joints[name].find("limit")
        assert limit is not None
        assert float(limit.attrib["velocity"]) == speed


def reach(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, way: np.ndarray, everything: bool
) -> float:
    """How far what collides of a body, or also what does not, reaches in a direction."""
    furthest = -np.inf
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        if not (everything or model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        turn = data.geom_xmat[geom].reshape(3, 3)
        local, size = turn.T @ way, model.geom_size[geom]
        match mujoco.mjtGeom(int(model.geom_type[geom])):
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                extent = size[0]
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                extent = size[0] + size[1] * abs(local[2])
            case mujoco.mjtGeom.mjGEOM_CYLINDER:
                extent = size[0] * np.hypot(*local[:2]) + size[1] * abs(local[2])
            case mujoco.mjtGeom.mjGEOM_BOX:
                extent = size @ np.abs(local)
            case _:
                mesh = model.geom_dataid[geom]
                begin = model.mesh_vertadr[mesh]
                vertices = model.mesh_vert[begin : begin + model.mesh_vertnum[mesh]]
                extent = (vertices @ local).max()
        furthest = max(furthest, float(way @ data.geom_xpos[geom] + extent))
    return furthest


@pytest.mark.parametrize("shown", [False, True])
def test_shapes_reach_as_far_in_every_direction(both: Both, shown: bool) -> None:
    if shown:  # What is drawn, too, which MuJoCo leaves out unless it is asked for.
        text = both.path.read_text("utf-8").replace("<compiler", '<compiler discardvisual="false"')
        (both.path.parent / "shown.urdf").write_text(text, "utf-8")
        read = mujoco.MjModel.from_xml_path(str(both.path.parent / "shown.urdf"))
        assert read.ngeom > both.read.ngeom
        both = both._replace(read=read)
    draw = np.random.default_rng(1)
    ours, its_data = both.pose(draw.uniform(*both.ours.jnt_range.T))
    compared = 0
    for way in draw.normal(size=(20, 3)):
        way /= np.linalg.norm(way)
        for mine, its in both.bodies():
            far = reach(both.ours, ours, mine, way, shown)
            assert reach(both.read, its_data, its, way, shown) == pytest.approx(far, abs=1e-6)
            compared += np.isfinite(far)
    assert compared > 1000


def test_no_shape_of_a_link_is_there_twice(both: Both) -> None:
    for link in Xml.parse(both.path).iter("link"):
        for kind in ("visual", "collision"):
            shapes = [
                tuple(Xml.tostring(part) for part in (each.find("origin"), each.find("geometry")))
                for each in link.findall(kind)
            ]
            assert len(shapes) == len({*shapes}), link.attrib["name"]


def test_it_is_one_tree_without_names_used_twice(both: Both) -> None:
    robot = Xml.parse(both.path).getroot()
    links = [link.attrib["name"] for link in robot.findall("link")]
    joints = [joint.attrib["name"] for joint in robot.findall("joint")]
    children = [child.attrib["link"] for child in robot.iter("child")]
    assert len(links) == len({*links}) == len(joints) + 1
    assert len(joints) == len({*joints})
    assert {*links} - {*children} == {"world"}
    assert {parent.attrib["link"] for parent in robot.iter("parent")} <= {*links}
    for mesh in robot.iter("mesh"):
        assert (both.path.parent / mesh.attrib["filename"]).is_file()

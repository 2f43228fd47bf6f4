"""MJCF: MuJoCo makes the same model of it, which plays the same."""

from __future__ import annotations

from xml.etree import ElementTree as Xml

import mujoco
import numpy as np
import pytest

from pianomime.export import mjcf
from pianomime.players.performance import Performance
from pianomime.world import World
from pianomime.world.model import build_spec, world_model
from pianomime.world_names import WORLDS


@pytest.mark.parametrize("world", WORLDS)
def test_every_number_of_the_model_is_the_same(world: str) -> None:
    ours, read = world_model(world), mujoco.MjModel.from_xml_string(mjcf(world))
    compared = 0
    for name in dir(ours):
        value = getattr(ours, name)
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(getattr(read, name), value, name)
            compared += value.size
    assert compared > 10_000
    assert read.names == ours.names
    options = [name for name in dir(ours.opt) if not name.startswith("_")]
    for name in options:
        np.testing.assert_array_equal(getattr(read.opt, name), getattr(ours.opt, name), name)


def test_it_plays_as_the_world_does_and_mujocos_own_does_not(performance: Performance) -> None:
    def leads_to(xml: str) -> float:
        world = World(mujoco.MjModel.from_xml_string(xml))
        assert world.name == performance.world
        for ctrl in performance.ctrl:
            world.step(ctrl)
        return float(np.abs(world.qpos - performance.qpos[-1]).max())

    assert leads_to(mjcf(performance.world)) == 0.0
    spec = build_spec(performance.world)
    spec.compile()
    assert leads_to(spec.to_xml()) > 0.0
    # The file needs no other: its meshes are in it.
    assert not [
        mesh
        for mesh in Xml.fromstring(mjcf(performance.world)).iter("mesh")
        if "file" in mesh.attrib
    ]

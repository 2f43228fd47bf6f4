"""MJCF of a world, MuJoCo's own format: what is compiled from it is the world's model again."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree as Xml

import mujoco
import numpy as np

from pianomime.world.model import build_spec

_WRITTEN_TO = 1e-5
"""Share of a number by which what MuJoCo writes may differ from it: six digits."""


def mjcf(world: str) -> str:
    """The XML of a world, which needs no other file.

    MuJoCo writes numbers with six digits, from which a simulation soon goes its own way. Here each
    number of bodies, joints, shapes and actuators has as many as it needs.

    Args:
        world: its name.

    Raises:
        InputError: there is no such world.
    """
    spec = build_spec(world)
    spec.compile()
    root = Xml.fromstring(spec.to_xml())
    for element, source in _pairs(root, spec):
        for name, text in element.attrib.items():
            if hasattr(source, name):
                element.set(name, _exact(text, getattr(source, name)))
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode") + "\n"


def _pairs(root: Xml.Element, spec: mujoco.MjSpec) -> Iterator[tuple[Xml.Element, Any]]:
    """Elements of the XML, each with the part of the spec that it was written from."""
    for element in root.iter("body"):
        body = spec.body(element.attrib["name"])
        yield element, body
        for inertial in element.findall("inertial"):
            inertia = {"pos": body.ipos, "quat": body.iquat, "diaginertia": body.inertia}
            yield inertial, SimpleNamespace(mass=body.mass, **inertia)
        for kind, parts in (("joint", body.joints), ("geom", body.geoms), ("site", body.sites)):
            yield from zip(element.findall(kind), parts, strict=True)
    for actuators in root.iter("actuator"):
        yield from zip(actuators, spec.actuators, strict=True)


def _exact(text: str, value: Any) -> str:
    """The numbers of an attribute with all their digits, if they are the given ones."""
    try:
        written = np.array(text.split(), float)
        exact = np.ravel(np.asarray(value, float))[: len(written)]
    except (TypeError, ValueError):
        return text
    if len(exact) != len(written) or not np.allclose(exact, written, rtol=_WRITTEN_TO, atol=0.0):
        return text
    if (exact == written).all():  # Also whole numbers, which must stay so.
        return text
    return " ".join(map(repr, exact.tolist()))

"""Looks of the world: floor, lights, cameras, materials and skins for the hands.

Nothing here affects the physics. The shapes that collide are boxes and capsules; where they look
crude they are hidden behind skins without mass or contact, each the convex hull of a few spheres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import mujoco
import numpy as np
from numpy.typing import NDArray

from pianomime.camera_names import CameraName
from pianomime.keyboard import BLACK, KEYS
from pianomime.palette import DARK, rgb
from pianomime.world.parameters import key_centres


@dataclass(frozen=True)
class View:
    """Where a camera or a light stands, and at what it looks.

    Attributes:
        pos: its place [m], world frame.
        target: the point in the middle of what it sees [m].
        fovy: vertical field of view of a camera [degrees].
    """

    pos: tuple[float, float, float]
    target: tuple[float, float, float]
    fovy: float = 45.0


# A narrow view from afar keeps the outer keys from fanning out.
CAMERA_VIEWS: dict[CameraName, View] = {
    "player": View((1.22, 0.0, 1.50), (0.075, 0.0, 0.0), 17.5),
    "top": View((0.10, 0.0, 2.20), (0.0999, 0.0, 0.0), 16.0),
    "side": View((0.62, 0.80, 0.42), (0.09, 0.06, 0.02), 34.0),
}
LIGHT_VIEW = View((0.8, -1.15, 2.4), (0.08, -0.07, 0.0))
"""The light that casts shadows."""

WHITE_KEY = (0.93, 0.92, 0.89)
BLACK_KEY = (0.07, 0.07, 0.08)
PRESSED_KEY = (0.25, 0.78, 0.42)
LAMP_OFF = (0.07, 0.07, 0.08)
BACKGROUND = (0.20, 0.22, 0.27)
"""Colours (red, green, blue), 0..1."""

_ACCENT = {
    side: tuple(part / 255 for part in rgb(colour))
    for side, colour in zip(("lh", "rh"), DARK.hands[:2], strict=True)
}
HIDDEN_GROUP = 3
"""Of shapes that are not shown, for they are behind a skin."""
_SKIN_GROUP = 1

_Sphere: TypeAlias = tuple[tuple[float, float, float], float]

# Spheres (centre, radius) [m] in the frame of a body of the right hand; the left is mirrored in x.
_SKINS: dict[str, tuple[tuple[str, Sequence[_Sphere]], ...]] = {
    "forearm": (
        ("shell", (((0.0, 0.0, 0.0), 0.043), ((0.0, -0.008, 0.17), 0.027))),
        ("accent", (((0.0, -0.008, 0.176), 0.0275), ((0.0, -0.009, 0.188), 0.0265))),
    ),
    "wrist": (
        (
            "joint",
            (
                ((-0.010, 0.0, -0.012), 0.015),
                ((0.010, 0.0, -0.012), 0.015),
                ((-0.014, 0.0, 0.034), 0.012),
                ((0.016, 0.0, 0.034), 0.012),
            ),
        ),
    ),
    "palm": (
        (
            "shell",
            (
                ((-0.026, 0.0, 0.006), 0.011),
                ((0.026, 0.0, 0.004), 0.011),
                ((-0.030, 0.0, 0.030), 0.011),
                ((-0.012, 0.002, 0.084), 0.009),
                ((0.010, 0.002, 0.087), 0.009),
                ((0.034, 0.002, 0.082), 0.009),
                ((0.031, -0.006, 0.030), 0.012),
            ),
        ),
    ),
    "lfmetacarpal": (
        (
            "shell",
            (
                ((0.001, 0.0, 0.010), 0.010),
                ((-0.001, 0.002, 0.052), 0.009),
                ((0.012, 0.0, 0.014), 0.009),
                ((0.012, 0.002, 0.054), 0.008),
            ),
        ),
    ),
}


def dress(spec: mujoco.MjSpec) -> None:
    """Add the looks to a spec of piano and hands, without changing its physics.

    Args:
        spec: as `pianomime.world.model.build_spec` makes it; changed in place.
    """
    _set_up_rendering(spec)
    _add_materials(spec)
    _add_scenery(spec)
    _add_lamps(spec)
    _add_cameras(spec)
    for key in range(KEYS):
        spec.geom(f"key_{key}").material = "black_key" if BLACK[key] else "white_key"
    for body in spec.bodies:
        side, _, name = body.name.partition("_")
        if side in _ACCENT:
            _dress_body(spec, body, side, name)


def key_colours(pressed: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(..., 88, 3) Colour of each key, 0..1.

    Args:
        pressed: (..., 88) bool, keys to colour as pressed.
    """
    resting = np.where(BLACK[:, None], BLACK_KEY, WHITE_KEY)
    # A black key in the full colour would look like a white one.
    down = np.where(BLACK[:, None], 0.7 * np.array(PRESSED_KEY), PRESSED_KEY)
    return np.where(pressed[..., None], down, resting).astype(np.float32)


def _set_up_rendering(spec: mujoco.MjSpec) -> None:
    visual = spec.visual
    visual.global_.offwidth, visual.global_.offheight = 3840, 2160
    # Enough for this scene, and what software OpenGL draws in reasonable time.
    visual.quality.shadowsize = 1536
    visual.quality.offsamples = 0  # `pianomime.world.render` smooths edges in a cheaper way
    visual.quality.numslices, visual.quality.numstacks = 20, 10
    visual.map.znear, visual.map.zfar = 0.1, 4.0
    visual.map.shadowclip = 0.8
    visual.headlight.ambient = (0.32, 0.32, 0.34)
    visual.headlight.diffuse = (0.22, 0.22, 0.22)
    visual.headlight.specular = (0.0, 0.0, 0.0)
    # MuJoCo derives clipping planes and light sizes from the model's extent.
    spec.stat.center = (0.1, 0.0, 0.0)
    spec.stat.extent = 1.0


def _add_materials(spec: mujoco.MjSpec) -> None:
    for name, colour, specular, shininess in (
        ("white_key", WHITE_KEY, 0.25, 0.6),
        ("black_key", BLACK_KEY, 0.5, 0.7),
        ("lacquer", (0.035, 0.035, 0.042), 0.6, 0.8),
        ("lamp", LAMP_OFF, 0.1, 0.1),
        ("felt", (0.36, 0.06, 0.09), 0.0, 0.0),
        ("floor", (0.17, 0.18, 0.21), 0.05, 0.1),
        ("shell", (0.80, 0.82, 0.85), 0.35, 0.5),
        ("joint", (0.15, 0.16, 0.19), 0.4, 0.5),
        ("accent_lh", _ACCENT["lh"], 0.3, 0.5),
        ("accent_rh", _ACCENT["rh"], 0.3, 0.5),
    ):
        spec.add_material(
            name=name, rgba=(*colour[:3], 1.0), specular=specular, shininess=shininess
        )


def _add_scenery(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=BACKGROUND,
        rgb2=(0.05, 0.05, 0.07),
        width=64,
        height=384,
    )
    world = spec.worldbody
    world.add_light(
        name="key_light",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=LIGHT_VIEW.pos,
        dir=np.subtract(LIGHT_VIEW.target, LIGHT_VIEW.pos),
        diffuse=(0.62, 0.60, 0.57),
        specular=(0.45, 0.45, 0.45),
        castshadow=True,
    )
    world.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=(0.0, 0.0, -0.05),
        size=(3.0, 3.0, 0.1),
        material="floor",
        contype=0,
        conaffinity=0,
    )
    base = spec.geom("piano_base")
    base.material = "lacquer"
    base.rgba = (0.035, 0.035, 0.042, 1.0)
    half_width = float(base.size[1])
    for name, material, pos, half_size in (
        ("cheek_left", "lacquer", (-0.05, -half_width - 0.022, -0.005), (0.127, 0.02, 0.045)),
        ("cheek_right", "lacquer", (-0.05, half_width + 0.022, -0.005), (0.127, 0.02, 0.045)),
        ("key_bed", "lacquer", (-0.05, 0.0, -0.034), (0.127, half_width + 0.002, 0.016)),
        ("felt_strip", "felt", (-0.0765, 0.0, 0.0275), (0.0015, half_width, 0.006)),
    ):
        world.add_geom(
            name=name,
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=pos,
            size=half_size,
            material=material,
            contype=0,
            conaffinity=0,
        )


def _add_lamps(spec: mujoco.MjSpec) -> None:
    """Add a lamp behind each key, which shows that it is pressed where a hand hides it."""
    base = spec.geom("piano_base")
    front, top = base.pos[0] + base.size[0], base.pos[2] + base.size[2]
    for key, (_, y, _) in enumerate(key_centres()):
        spec.worldbody.add_geom(
            name=f"lamp_{key}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            # Lamps of black keys sit a little further back, so that neighbours stay apart.
            pos=(front - (0.024 if BLACK[key] else 0.011), y, top),
            size=(0.005, 0.005, 0.0005),
            material="lamp",
            contype=0,
            conaffinity=0,
        )


def _add_cameras(spec: mujoco.MjSpec) -> None:
    for name, view in CAMERA_VIEWS.items():
        spec.worldbody.add_camera(
            name=name, pos=view.pos, quat=_look_at(view.pos, view.target), fovy=view.fovy
        )


def _dress_body(spec: mujoco.MjSpec, body: mujoco.MjsBody, side: str, name: str) -> None:
    skins = _SKINS.get(name, ())
    for geom in body.geoms:
        if skins:
            geom.group = HIDDEN_GROUP
            continue
        if name.endswith("distal"):
            material = f"accent_{side}"
        elif name.endswith(("knuckle", "hub", "base")):
            material = "joint"
        else:
            material = "shell"
        geom.material = material
        geom.rgba = spec.material(material).rgba
    mirror = np.array([-1.0 if side == "lh" else 1.0, 1.0, 1.0])
    for number, (look, spheres) in enumerate(skins):
        mesh = f"{body.name}_skin_{number}"
        material = f"accent_{side}" if look == "accent" else look
        spec.add_mesh(name=mesh, uservert=(_hull_points(spheres) * mirror).ravel())
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=mesh,
            material=material,
            mass=0.0,
            contype=0,
            conaffinity=0,
            group=_SKIN_GROUP,
        )


def _hull_points(spheres: Sequence[_Sphere]) -> NDArray[np.float64]:
    """(N, 3) Points on the surface of spheres; MuJoCo makes their convex hull the skin."""
    polar, around = np.meshgrid(
        np.linspace(0.0, np.pi, 9), np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    )
    direction = np.stack(
        (np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)), axis=-1
    ).reshape(-1, 3)
    return np.concatenate([centre + radius * direction for centre, radius in spheres])


def _look_at(pos: Sequence[float], target: Sequence[float]) -> NDArray[np.float64]:
    """(4,) Quaternion of a camera at `pos` that looks at `target`, with the treble to its right."""
    back = np.subtract(pos, target)
    back /= np.linalg.norm(back)
    # Seen from the treble end, the keyboard's y axis is no longer the horizontal of the picture.
    right = np.cross((0.0, 0.0, 1.0), back)
    right /= np.linalg.norm(right)
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, np.column_stack((right, np.cross(back, right), back)).ravel())
    return quat

"""Pictures and videos of a performance, rendered with the OpenGL that the machine has."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import av
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.camera_names import CAMERAS
from pianomime.closing import Closing
from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.mp4 import Mp4
from pianomime.music.sound import SAMPLE_RATE
from pianomime.music.wav import WavFile
from pianomime.progress import Progress, no_progress
from pianomime.world.model import build_spec
from pianomime.world.scene_look import LAMP_OFF, dress, key_colours

_MAX_GEOMS = 1000
# Edges are smoothed by rendering larger and shrinking: with OpenGL in software this costs half as
# much as multisampling.
_VIDEO_OVERSIZE = 1.5
_PICTURE_OVERSIZE = 2.0
_SILENCED = ("disable", "disabled", "off", "false", "0")
_NEEDS = {
    "cgl": "a screen",
    "egl": "on Debian or Ubuntu `apt-get install libegl1 libgl1`",
    "glfw": "a screen, and on Linux X11",
    "osmesa": "on Debian or Ubuntu `apt-get install libosmesa6`",
}
"""What each backend of `mujoco` needs."""
_SHRINKING = av.video.reformatter.Interpolation.AREA
_PROBE = """
import importlib, signal, sys, mujoco
# A driver may hang, and whoever waits for it may be killed meanwhile.
getattr(signal, "alarm", int)(int(sys.argv[2]))
context = importlib.import_module("mujoco." + sys.argv[1]).GLContext(64, 64)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
"""
_PROBE_SECONDS = 60


class RenderUnavailable(RuntimeError):  # noqa: N818 - a property of the machine, not an error
    """This machine cannot render; the message is one line that says what to install."""


@dataclass(frozen=True)
class View:
    """Where a video is taken from, and its size."""

    camera: str = "player"
    """One of `pianomime.camera_names.CAMERAS`."""
    size: tuple[int, int] = (1280, 544)
    """Width and height [pixels], both even for H.264."""


class Painter(Closing):
    """Renders the world. Use it as a context manager, in the thread that made it.

    Attributes:
        width: of its pictures [pixels].
        height: of its pictures [pixels].
    """

    def __init__(
        self, width: int, height: int, camera: str = "player", smooth: bool = False
    ) -> None:
        """Create an OpenGL context and a camera.

        Args:
            width: of the pictures [pixels].
            height: of the pictures [pixels].
            camera: one of `pianomime.camera_names.CAMERAS`.
            smooth: whether edges are smoothed.

        Raises:
            RenderUnavailable: there is no working OpenGL.
            ValueError: there is no such camera, or the size is not positive.
        """
        if camera not in CAMERAS:
            raise ValueError(f"camera must be one of {', '.join(CAMERAS)}, not {camera}")
        if width < 1 or height < 1:
            raise ValueError(f"a picture of {width}x{height} pixels cannot be drawn")
        backend = _backend()
        self.width, self.height = width, height
        self._size = _oversize((width, height), _PICTURE_OVERSIZE if smooth else 1.0)
        self._model = _dressed_model(*self._size)
        self._data = mujoco.MjData(self._model)
        self._keys, self._lamps = (
            np.array([self._model.geom(f"{name}_{key}").id for key in range(KEYS)])
            for name in ("key", "lamp")
        )
        self._resting = key_colours(np.zeros(KEYS, bool))
        self._scene = mujoco.MjvScene(self._model, _MAX_GEOMS)
        # Reflections double the work, and few surfaces here would show them.
        self._scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = False
        self._option = mujoco.MjvOption()
        self._camera = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED
        self._camera.fixedcamid = self._model.camera(camera).id
        self._rectangle = mujoco.MjrRect(0, 0, *self._size)
        # Not `mujoco.Renderer`: it chooses its backend when mujoco is imported, by MUJOCO_GL alone,
        # and without that variable takes one that needs a display.
        self._gl = importlib.import_module(f"mujoco.{backend}").GLContext(*self._size)
        self._gl.make_current()
        self._context = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)

    def paint(self, qpos: ArrayLike, colours: ArrayLike) -> NDArray[np.uint8]:
        """Render one frame.

        Args:
            qpos: (142,) positions: 88 keys, right hand 27, left hand 27 [rad, m].
            colours: (88, 3) red, green and blue of each key, 0..1; the lamp behind a key whose
                colour is not that of a key at rest is lit in the same colour.

        Returns:
            (height, width, 3) uint8.
        """
        self._data.qpos[:] = qpos
        self._model.geom_rgba[self._keys, :3] = colours
        lit = (np.asarray(colours) != self._resting).any(axis=1, keepdims=True)
        self._model.geom_rgba[self._lamps, :3] = np.where(lit, colours, LAMP_OFF)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        mujoco.mjv_updateScene(
            self._model,
            self._data,
            self._option,
            None,
            self._camera,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        self._gl.make_current()
        mujoco.mjr_render(self._rectangle, self._scene, self._context)
        picture = np.empty((*reversed(self._size), 3), np.uint8)
        mujoco.mjr_readPixels(picture, None, self._rectangle, self._context)
        picture = picture[::-1]  # OpenGL counts rows from below
        if self._size == (self.width, self.height):
            return picture
        large = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
        small = large.reformat(self.width, self.height, "rgb24", interpolation=_SHRINKING)
        return np.asarray(small.to_ndarray(), np.uint8)

    def close(self) -> None:
        """Free the OpenGL context."""
        self._gl.make_current()
        self._context.free()
        self._gl.free()


def render_frame(
    qpos: ArrayLike,
    pressed: NDArray[np.bool_],
    width: int = 1920,
    height: int = 816,
    camera: str = "player",
) -> NDArray[np.uint8]:
    """Render one picture.

    Args:
        qpos: (142,) positions: 88 keys, right hand 27, left hand 27 [rad, m].
        pressed: (88,) bool, keys to show as pressed.
        width: of the picture [pixels].
        height: of the picture [pixels].
        camera: one of `pianomime.camera_names.CAMERAS`.

    Returns:
        (height, width, 3) uint8.

    Raises:
        RenderUnavailable: there is no working OpenGL.
        ValueError: there is no such camera, or the size is not positive.
    """
    with Painter(width, height, camera, smooth=True) as painter:
        return painter.paint(qpos, key_colours(pressed))


def write_video(
    path: str | os.PathLike[str],
    qpos: Sequence[NDArray[np.float64]] | NDArray[np.float64],
    pressed: NDArray[np.bool_],
    audio: NDArray[np.float32] | WavFile | None,
    sample_rate: int = SAMPLE_RATE,
    *,
    colours: Callable[[int], NDArray[np.float32]] | None = None,
    view: View | None = None,
    fps: int = round(FRAME_RATE),
    progress: Progress = no_progress,
) -> None:
    """Render a performance with its sound as MP4 (H.264, AAC).

    The video ends with the last frame; sound that rings on is cut there. Frames are encoded as
    they are rendered, so memory does not grow with the song.

    Args:
        path: the file; it appears only when complete.
        qpos: T times (142,) positions: 88 keys, right hand 27, left hand 27 [rad, m].
        pressed: (T, 88) bool, keys to show as pressed.
        audio: (S, 2) sound, -1..1, or None for a silent video.
        sample_rate: of the sound [Hz].
        colours: gives the colours (88, 3) of the keys in a frame, 0..1; None for those of
            `key_colours(pressed)`.
        view: camera and size.
        fps: pictures per second, of which T are given.
        progress: called after every frame, in the phase "rendering".

    Raises:
        RenderUnavailable: there is no working OpenGL.
        ValueError: the shapes do not match, there are no frames, or the size is odd.
    """
    view = view or View()
    frames = len(qpos)
    if not frames:
        raise ValueError("a performance without frames cannot be rendered")
    if pressed.shape != (frames, KEYS):
        raise ValueError(f"pressed must be ({frames}, {KEYS}), not {pressed.shape}")
    if audio is not None and (len(audio.shape) != 2 or audio.shape[1] != 2):
        raise ValueError(f"audio must be (S, 2), not {audio.shape}")
    if view.size[0] % 2 or view.size[1] % 2:
        raise ValueError(f"H.264 needs an even size, not {view.size[0]}x{view.size[1]}")
    with (
        Painter(*_oversize(view.size, _VIDEO_OVERSIZE), view.camera) as painter,
        atomic(path) as temporary,
        Mp4(temporary, view.size, None if audio is None else sample_rate, fps=fps) as film,
    ):
        for frame in range(frames):
            shown = key_colours(pressed[frame]) if colours is None else colours(frame)
            sound = None if audio is None else audio[slice(*film.span)]
            film.add(painter.paint(qpos[frame], shown), sound)
            progress("rendering", frame + 1, frames)


def _oversize(size: tuple[int, int], factor: float) -> tuple[int, int]:
    width, height = size
    return round(factor * width), round(factor * height)


def _dressed_model(width: int, height: int) -> mujoco.MjModel:
    """A model of its own for rendering, because the colours of its keys change."""
    spec = build_spec()
    dress(spec)
    # The buffer is allocated and cleared at this size, whatever the size of the picture.
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    return spec.compile()


@cache
def _backend() -> str:
    """Name of the module of `mujoco` whose GLContext works here without a display.

    Raises:
        RenderUnavailable: none does, or MUJOCO_GL switches rendering off.
    """
    wanted = os.environ.get("MUJOCO_GL", "").lower().strip()
    if wanted in _SILENCED:
        raise RenderUnavailable(f"no video: rendering is switched off by MUJOCO_GL={wanted}")
    chosen = wanted in _candidates()
    for backend in (wanted,) if chosen else _candidates():
        if _works(backend):
            return backend
    if chosen:
        raise RenderUnavailable(
            f"no video: MUJOCO_GL={wanted} does not work here; unset it, or give it what it needs: "
            f"{_NEEDS[wanted]}"
        )
    raise RenderUnavailable(_advice())


def _candidates() -> tuple[str, ...]:
    if sys.platform == "darwin":
        return ("cgl", "glfw")
    if sys.platform == "win32":
        return ("glfw",)
    return ("egl", "osmesa", "glfw")


def _works(backend: str) -> bool:
    """Try a backend in a process of its own, because a broken driver can crash its process."""
    try:
        probe = subprocess.run(
            [sys.executable, "-c", _PROBE, backend, str(_PROBE_SECONDS)],
            # With an unknown name here, importing mujoco itself fails.
            env={**os.environ, "MUJOCO_GL": backend},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_PROBE_SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return False
    return probe.returncode == 0


def _advice() -> str:
    if sys.platform == "linux":
        return (
            "no video: there is no working OpenGL here; on Debian or Ubuntu install it with "
            "`apt-get install libegl1 libgl1`"
        )
    return "no video: there is no working OpenGL here; install a graphics driver"

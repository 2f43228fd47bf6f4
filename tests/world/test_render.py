from __future__ import annotations

from pathlib import Path

import av
import mujoco
import numpy as np
import pytest

from pianomime.camera_names import CAMERAS
from pianomime.keyboard import KEYS
from pianomime.world import render
from pianomime.world.model import build_spec
from pianomime.world.parameters import key_travel
from pianomime.world.render import RenderUnavailable, View, render_frame, write_video
from pianomime.world.scene_look import dress

POSITIONS = 142
SMALL = (160, 68)


@pytest.fixture
def opengl() -> None:
    try:
        render_frame(np.zeros(POSITIONS), np.zeros(KEYS, bool), 16, 16)
    except RenderUnavailable as reason:
        pytest.skip(str(reason))


@pytest.fixture
def no_opengl(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setattr(render, "_works", lambda backend: False)
    render._backend.cache_clear()
    # Else later tests would believe that there is none.
    yield
    render._backend.cache_clear()


def performance(frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Frames in which one key after the other is down, and the hands wander."""
    qpos = np.zeros((frames, POSITIONS))
    pressed = np.zeros((frames, KEYS), bool)
    at = np.arange(frames)
    key = (3 * at) % KEYS
    pressed[at, key] = True
    qpos[at, key] = key_travel()[key]
    qpos[:, [88, 115]] = 0.1 * np.sin(at / 5.0)[:, None]
    return qpos, pressed


def test_dressing_leaves_the_physics_alone() -> None:
    plain, dressed = build_spec(), build_spec()
    dress(dressed)
    one, other = plain.compile(), dressed.compile()
    for size in ("nq", "nv", "nu", "njnt", "nbody", "ntendon"):
        assert getattr(one, size) == getattr(other, size), size
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "dof_damping"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    skins = other.ngeom - one.ngeom
    touching = (other.geom_contype != 0) | (other.geom_conaffinity != 0)
    assert skins > 0
    assert touching.sum() == ((one.geom_contype != 0) | (one.geom_conaffinity != 0)).sum()


def test_a_dressed_world_moves_like_a_plain_one() -> None:
    plain, dressed = build_spec(), build_spec()
    dress(dressed)
    ends = []
    for spec in (plain, dressed):
        model = spec.compile()
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.3 * model.actuator_ctrlrange[:, 0] + 0.7 * model.actuator_ctrlrange[:, 1]
        mujoco.mj_step(model, data, nstep=100)
        ends.append(data.qpos.copy())
    np.testing.assert_array_equal(*ends)


@pytest.mark.usefixtures("opengl")
@pytest.mark.parametrize("camera", CAMERAS)
def test_every_camera_sees_keys_and_hands(camera: str) -> None:
    picture = render_frame(np.zeros(POSITIONS), np.zeros(KEYS, bool), 320, 136, camera)
    assert picture.shape == (136, 320, 3)
    assert picture.dtype == np.uint8
    # White keys, black keys, and the two hands in their colours.
    red, green, blue = picture.astype(int).transpose(2, 0, 1)
    assert ((red > 200) & (green > 200) & (blue > 180)).mean() > 0.02
    assert ((red < 40) & (green < 40) & (blue < 40)).mean() > 0.02
    assert ((red - blue) > 80).any()
    assert ((blue - red) > 80).any()


@pytest.mark.usefixtures("opengl")
def test_a_pressed_key_shows_where_it_is() -> None:
    qpos, up = np.zeros(POSITIONS), np.zeros(KEYS, bool)
    rest = render_frame(qpos, up, 640, 272).astype(int)
    for key, columns in ((0, slice(0, 160)), (87, slice(480, 640))):
        down = up.copy()
        down[key] = True
        changed = np.abs(render_frame(qpos, down, 640, 272) - rest).max(axis=2) > 40
        assert changed.sum() > 50
        assert changed[:, columns].sum() == changed.sum()


@pytest.mark.usefixtures("opengl")
def test_a_film_has_every_frame_and_its_sound(tmp_path: Path) -> None:
    frames, rate = 30, 22050
    qpos, pressed = performance(frames)
    # Longer than the film on purpose: sound rings on after the last frame.
    audio = np.zeros((2 * rate, 2), np.float32)
    audio[rate // 2 :] = 0.5 * np.sin(np.arange(3 * rate // 2) * 0.2)[:, None]
    reported: list[tuple[object, ...]] = []
    path = tmp_path / "film.mp4"
    write_video(
        path,
        qpos,
        pressed,
        audio,
        rate,
        view=View(size=SMALL),
        progress=lambda *done: reported.append(done),
    )
    assert reported == [("rendering", frame + 1, frames) for frame in range(frames)]
    with av.open(str(path)) as film:
        assert film.streams.video[0].codec_context.name == "h264"
        assert film.streams.audio[0].codec_context.name == "aac"
        assert film.duration / av.time_base == pytest.approx(frames / 20, abs=0.06)
    with av.open(str(path)) as film:
        pictures = [picture.to_ndarray(format="rgb24") for picture in film.decode(video=0)]
    assert len(pictures) == frames
    assert pictures[0].shape == (SMALL[1], SMALL[0], 3)
    assert np.abs(pictures[0].astype(int) - pictures[15]).max() > 60
    with av.open(str(path)) as film:
        sound = np.concatenate([part.to_ndarray()[0] for part in film.decode(audio=0)])
    # In sync: silent before half a second, loud after it.
    assert np.abs(sound[: int(0.47 * rate)]).max() < 0.05
    assert np.abs(sound[int(0.55 * rate) : rate]).max() > 0.3


@pytest.mark.usefixtures("opengl")
def test_a_film_may_be_silent_and_have_its_own_colours(tmp_path: Path) -> None:
    qpos, pressed = performance(4)
    red = np.full((KEYS, 3), (1.0, 0.0, 0.0), np.float32)
    path = tmp_path / "film.mp4"
    write_video(path, qpos, pressed, None, colours=lambda _: red, view=View(size=SMALL))
    with av.open(str(path)) as film:
        assert not film.streams.audio
        picture = next(film.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    assert ((picture[..., 0] - picture[..., 1]) > 100).mean() > 0.05


@pytest.mark.usefixtures("opengl")
def test_an_interrupted_film_leaves_nothing(tmp_path: Path) -> None:
    def interrupt(phase: str, done: int, total: int, remark: str = "") -> None:
        raise KeyboardInterrupt

    qpos, pressed = performance(5)
    with pytest.raises(KeyboardInterrupt):
        write_video(
            tmp_path / "film.mp4", qpos, pressed, None, view=View(size=SMALL), progress=interrupt
        )
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("no_opengl")
def test_without_opengl_one_line_says_what_to_install(tmp_path: Path) -> None:
    qpos, pressed = performance(3)
    with pytest.raises(RenderUnavailable) as reason:
        write_video(tmp_path / "film.mp4", qpos, pressed, None)
    assert "\n" not in str(reason.value)
    assert "install" in str(reason.value)
    with pytest.raises(RenderUnavailable):
        render_frame(qpos[0], pressed[0])
    assert not list(tmp_path.iterdir())


def test_a_backend_that_dies_does_not_take_us_along(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(render, "_PROBE", "import os; os.abort()")
    assert not render._works("egl")


def test_mujoco_gl_can_switch_rendering_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")
    render._backend.cache_clear()
    try:
        with pytest.raises(RenderUnavailable, match="MUJOCO_GL"):
            render_frame(np.zeros(POSITIONS), np.zeros(KEYS, bool))
    finally:
        render._backend.cache_clear()


@pytest.mark.parametrize(
    ("qpos", "pressed", "audio", "size"),
    [
        ((0, 142), (0, 88), None, SMALL),
        ((3, 142), (4, 88), None, SMALL),
        ((3, 142), (3, 88), (100,), SMALL),
        ((3, 142), (3, 88), None, (161, 68)),
    ],
)
def test_shapes_that_do_not_fit_are_refused(
    tmp_path: Path,
    qpos: tuple[int, ...],
    pressed: tuple[int, ...],
    audio: tuple[int, ...] | None,
    size: tuple[int, int],
) -> None:
    with pytest.raises(ValueError, match=r"must be|without frames|even"):
        write_video(
            tmp_path / "film.mp4",
            np.zeros(qpos),
            np.zeros(pressed, bool),
            None if audio is None else np.zeros(audio, np.float32),
            view=View(size=size),
        )


def test_an_unknown_camera_is_refused() -> None:
    with pytest.raises(ValueError, match="player"):
        render_frame(np.zeros(POSITIONS), np.zeros(KEYS, bool), camera="nowhere")

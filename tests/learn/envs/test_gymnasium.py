"""The environment as Gymnasium finds it, and its pictures."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo, RenderCollection

from pianomime.errors import InputError
from pianomime.learn.envs.gym_env import RENDER_SIZE, SongEnv
from pianomime.plan.demonstration import Demonstration
from pianomime.world.render import RenderUnavailable, render_frame

ENV = "pianomime.learn:pianomime/Song-v0"


@pytest.fixture
def opengl() -> None:
    try:
        render_frame(np.zeros(142), np.zeros(88, bool), 16, 16)
    except RenderUnavailable as reason:
        pytest.skip(str(reason))


@pytest.mark.parametrize(
    ("call", "shape"), [("make(env", "(367,)"), ("make_vec(env, num_envs=2", "(2, 367)")]
)
def test_it_is_found_without_an_import(
    two_notes: Demonstration, tmp_path: Path, call: str, shape: str
) -> None:
    two_notes.save(tmp_path / "demo.npz")
    script = (
        "import gymnasium\n"
        f"env = {ENV!r}\n"
        f"env = gymnasium.{call}, demonstration='demo.npz')\n"
        "print(env.reset(seed=0)[0].shape)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == shape


@pytest.mark.usefixtures("opengl")
def test_pictures_show_what_is_played(two_notes: Demonstration) -> None:
    env = RenderCollection(
        gymnasium.make(ENV, demonstration=two_notes, config="best", render_mode="rgb_array")
    )
    env.reset(seed=0)
    for _ in range(8):
        env.step(np.zeros(46, np.float32))
    pictures = env.render()
    env.close()
    assert len(pictures) == 9
    width, height = RENDER_SIZE
    assert pictures[0].shape == (height, width, 3)
    assert pictures[0].dtype == np.uint8
    assert np.abs(pictures[0].astype(int) - pictures[-1]).max() > 60


@pytest.mark.usefixtures("opengl")
@pytest.mark.skipif(
    importlib.util.find_spec("moviepy") is None, reason="Gymnasium's RecordVideo needs moviepy"
)
def test_videos_are_recorded(two_notes: Demonstration, tmp_path: Path) -> None:
    env = RecordVideo(
        gymnasium.make(ENV, demonstration=two_notes, render_mode="rgb_array"),
        str(tmp_path / "videos"),
    )
    env.reset(seed=0)
    over = False
    while not over:
        over = env.step(np.zeros(46, np.float32))[2]
    env.close()
    assert list((tmp_path / "videos").glob("*.mp4"))


def test_it_renders_at_the_rate_of_control(two_notes: Demonstration) -> None:
    env = gymnasium.make(ENV, demonstration=two_notes)
    assert env.metadata["render_modes"] == ["rgb_array"]
    assert env.metadata["render_fps"] == 20
    env.close()
    with pytest.raises(InputError, match="rgb_array"):
        SongEnv(two_notes, render_mode="ansi")

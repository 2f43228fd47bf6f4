"""MUJOCO_GL names an OpenGL whose library this machine lacks: there is no film, and all else is."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

BROKEN = "raise AttributeError(\"'NoneType' object has no attribute 'glGetError'\")\n"
"""What PyOpenGL raises, in some module of it, where the library that it wants is not there."""


@pytest.fixture
def lacking(tmp_path: Path) -> dict[str, str]:
    """The environment of a process in which PyOpenGL finds no library."""
    package = tmp_path / "lacking" / "OpenGL"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(BROKEN)
    return {**os.environ, "PYTHONPATH": str(package.parent)}


@pytest.mark.skipif(sys.platform != "linux", reason="EGL and OSMesa are backends on Linux")
@pytest.mark.parametrize("named", ["osmesa", "egl"])
def test_one_line_says_why_there_is_no_film(
    named: str, lacking: dict[str, str], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    options = ["--seconds", "0.5", "--effort", "0", "--video", "-o", str(out)]
    done = subprocess.run(
        [sys.executable, "-m", "pianomime", "play", "c-major-study", *options],
        env={**lacking, "MUJOCO_GL": named},
        capture_output=True,
        text=True,
        check=True,
    )
    assert not done.stderr
    (line,) = (line for line in done.stdout.splitlines() if "no video" in line)
    assert f"MUJOCO_GL={named}" in line
    assert "apt-get install" in line
    assert (out / "report.html").exists()
    assert (out / "performance.wav").exists()
    assert not (out / "performance.mp4").exists()


@pytest.mark.parametrize("module", ["world.layout", "track.dynamic", "evaluation.song_worker"])
def test_a_name_that_mujoco_does_not_know(module: str) -> None:
    """Whichever module is imported first; the variable stays what it was."""
    script = f"import os, pianomime.{module}, mujoco; print(os.environ['MUJOCO_GL'])"
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "MUJOCO_GL": "voodoo"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "voodoo\n"

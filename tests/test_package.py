"""What is published: builds it from a clean copy, installs it, and plays with it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest
import yaml

import pianomime

ROOT = Path(__file__).parents[1]
# Data that the program is nothing without; its modules are compared one by one.
DATA = (
    "plan/reach.json",
    "policies/weights/fingers.onnx",
    "policies/weights/fingering.onnx",
    "policies/weights/hand-controls.onnx",
    "policies/weights/hand-motion.onnx",
    "policies/weights/high-diff.onnx",
    "policies/weights/low-diff.onnx",
    "policies/weights/README.md",
    "py.typed",
    "songs/beethoven-ode-to-joy.mid",
    "world/parameters.json",
)


PAGE = Path("src/pianomime/replay/page/replay.js")
"""Is built, and not under version control."""


def run(command: list[str], folder: Path) -> str:
    env = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


def tracked() -> list[Path]:
    """Files under version control, or about to be, as they are now."""
    try:
        listed = run(["git", "ls-files", "-z", "-co", "--exclude-standard"], ROOT)
    except (OSError, AssertionError):
        pytest.skip("not a checkout")
    files = sorted({Path(name) for name in listed.split("\0") if name})
    return [file for file in files if (ROOT / file).is_file()]


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the wheel and the sdist."""
    copy = tmp_path_factory.mktemp("copy")
    for file in tracked():
        (copy / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, copy / file)
    (copy / PAGE).parent.mkdir(exist_ok=True)
    (copy / PAGE).write_text("built()")
    run([sys.executable, "-m", "hatchling", "build"], copy)
    return copy / "dist"


@pytest.fixture(scope="module")
def wheel(dist: Path) -> Path:
    (found,) = dist.glob("*.whl")
    return found


def package_files(wheel: Path) -> set[str]:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    return {name for name in names if name.startswith("pianomime/")}


def test_the_wheel_holds_the_whole_package_and_nothing_else(wheel: Path) -> None:
    source = {
        str(file.relative_to("src")) for file in tracked() if file.parts[:2] == ("src", "pianomime")
    }
    assert package_files(wheel) == source | {str(PAGE.relative_to("src"))}
    assert {f"pianomime/{name}" for name in DATA} <= source


def test_the_wheel_tells_its_licence_and_where_it_was_tried(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        info = next(name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        text = archive.read(info).decode()
    told = Parser().parsestr(text)
    assert told["Version"] == pianomime.__version__
    assert told["Requires-Python"] == ">=3.11"
    assert told["License-Expression"] == "Apache-2.0"
    assert set(told.get_all("License-File")) == {"LICENSE", "NOTICE"}
    classifiers = told.get_all("Classifier")
    assert [line for line in classifiers if "Python :: 3." in line] == [
        "Programming Language :: Python :: 3.11"
    ]
    assert "Typing :: Typed" in classifiers


def test_the_sdist_makes_the_same_wheel(dist: Path, wheel: Path, tmp_path: Path) -> None:
    (sdist,) = dist.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(tmp_path, filter="data")
    (source,) = tmp_path.iterdir()
    run([sys.executable, "-m", "hatchling", "build", "-t", "wheel"], source)
    (made,) = (source / "dist").glob("*.whl")
    assert package_files(made) == package_files(wheel)


def test_the_installed_wheel_plays(wheel: Path, tmp_path: Path) -> None:
    # The dependencies are those of this environment: to install them anew takes longer than all
    # other tests of the package, and the network. `benchmarks/install.py` does that.
    venv.EnvBuilder(with_pip=False, symlinks=os.name != "nt").create(tmp_path / "env")
    scripts = tmp_path / "env" / ("Scripts" if os.name == "nt" else "bin")
    python = str(scripts / Path(sys.executable).name)
    installed = Path(
        run([python, "-c", "import site; print(site.getsitepackages()[0])"], tmp_path).strip()
    )
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet"]
    run([*install, "--no-deps", "--no-index", str(wheel)], tmp_path)
    # A .pth file within it is not followed, so the checkout that is installed there stays hidden.
    (installed / "dependencies.pth").write_text(sysconfig.get_paths()["purelib"])

    where = run([python, "-c", "import pianomime; print(pianomime.__file__)"], tmp_path)
    assert Path(where.strip()).is_relative_to(tmp_path)
    command = str(scripts / "pianomime")
    assert run([command, "--version"], tmp_path).split() == ["pianomime", pianomime.__version__]
    run([command, "play", "ode-to-joy", "--seconds", "2", "-o", "out"], tmp_path)
    assert (tmp_path / "out" / "report.html").exists()


def test_the_citation_is_of_this_version() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert cited["version"] == pianomime.__version__
    assert cited["license"] == "Apache-2.0"
    assert {"cff-version", "message", "title", "authors"} <= set(cited)
    (paper,) = cited["references"]
    assert "2407.18178" in paper["url"]

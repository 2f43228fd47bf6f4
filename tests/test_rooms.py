"""The rooms: imports only downward, torch only in learn/, and a true tree in the documentation."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "pianomime"

ROOMS = (
    (
        *("errors", "installation", "keyboard", "palette", "progress", "short_repr", "shown"),
        *("camera_names", "closing", "device_names", "stop", "world_names"),
    ),
    ("file_names", "staging", "schema", "seal"),
    ("files", "archive", "local_server", "mp4", "sealed_json", "validation", "web_page", "workers"),
    ("ray_cluster",),
    ("media",),
    ("music",),
    ("songs",),
    ("world",),
    ("plan",),
    ("track",),
    ("policies",),
    ("players",),
    ("export",),
    ("transcription",),
    ("video",),
    ("learn",),
    ("evaluation",),
    ("replay",),
    ("report",),
    ("stage",),
    ("commands",),
    ("cli",),
    ("__main__",),
)
"""From the ground up: a room imports only from rooms on the lines above its own."""

LEARN = (
    ("runs",),
    ("envs",),
    ("expert",),
    ("data",),
    ("export", "goal"),
    ("imitation",),
    ("fingers", "sac", "three_stage"),
)
VIDEO = (
    ("film",),
    ("keyboard",),
    ("hands",),
    ("notes",),
    ("align", "parallax", "drawing", "keyboard_look", "advice"),
    ("confidence",),
    ("remarks", "repairs"),
    ("verdict",),
    ("lit_film", "retarget"),
    ("overlay", "recording_notes", "moments", "timeline"),
    ("summary",),
)

LEARN_ONLY = ("torch", "stable_baselines3", "sb3_contrib", "diffusers", "accelerate", "gymnasium")
"""Libraries that only learn/ imports."""
LISTENER = ("pianomime.transcription.transkun", "torch")
"""The one file elsewhere that imports one of them, and is imported when it is needed."""


@cache
def graph() -> grimp.ImportGraph:
    """All imports of the package, also those inside functions and for type checkers."""
    return grimp.build_graph("pianomime", include_external_packages=True, cache_dir=None)


def imports(package: str) -> list[tuple[str, str]]:
    """(importer, imported) among the modules of a package."""
    inside = [name for name in graph().modules if name.startswith(f"{package}.")]
    return [
        (name, other)
        for name in sorted(inside)
        for other in sorted(graph().find_modules_directly_imported_by(name))
        if other.startswith(f"{package}.")
    ]


def room(name: str, package: str) -> str:
    """The room of a module: the first name below the package."""
    return name.removeprefix(f"{package}.").partition(".")[0]


def upward(package: str, rooms: tuple[tuple[str, ...], ...]) -> set[tuple[str, str]]:
    """Imports of a room on the same line or on one above."""
    level = {name: number for number, names in enumerate(rooms) for name in names}
    return {
        (name, other)
        for name, other in imports(package)
        if room(name, package) != room(other, package)
        and level[room(name, package)] <= level[room(other, package)]
    }


@pytest.mark.parametrize(
    ("package", "rooms"),
    [
        ("pianomime", ROOMS),
        ("pianomime.learn", LEARN),
        ("pianomime.video", VIDEO),
    ],
)
def test_imports_go_downward_only(package: str, rooms: tuple[tuple[str, ...], ...]) -> None:
    assert not upward(package, rooms)


@pytest.mark.parametrize(
    ("folder", "rooms"), [(SOURCE, ROOMS), (SOURCE / "learn", LEARN), (SOURCE / "video", VIDEO)]
)
def test_every_room_has_its_place_in_the_order(
    folder: Path, rooms: tuple[tuple[str, ...], ...]
) -> None:
    there = {file.stem for file in folder.glob("*.py")} - {"__init__"}
    there |= {file.parent.name for file in folder.glob("*/__init__.py")}
    assert there == {name for names in rooms for name in names}


def test_the_front_page_of_the_package_imports_late() -> None:
    """`pianomime/__init__.py` names what is public, but imports nothing when it is imported."""
    late = grimp.build_graph("pianomime", exclude_type_checking_imports=True, cache_dir=None)
    assert not late.find_modules_directly_imported_by("pianomime")


@pytest.mark.parametrize("library", LEARN_ONLY)
def test_libraries_of_training_are_imported_in_learn_alone(library: str) -> None:
    if library not in graph().modules:
        pytest.skip(f"nothing imports {library}")
    for name in graph().find_modules_that_directly_import(library):
        allowed = f"{name}.".startswith("pianomime.learn.") or (name, library) == LISTENER
        assert allowed, f"{name} imports {library}"


def test_rooms_have_at_most_twelve_files() -> None:
    for folder in (SOURCE / "learn").iterdir():
        if folder.is_dir() and folder.name != "__pycache__":
            files = {file.name for file in folder.glob("*.py")} - {"__init__.py"}
            assert len(files) <= 12, f"{folder.name}: {sorted(files)}"


def documented_tree() -> set[str]:
    """The paths of the tree in docs/architecture.md, relative to src/pianomime/.

    Every line but the first is an indented name, and after two spaces or more a description.
    """
    text = (ROOT / "docs" / "architecture.md").read_text("utf-8")
    (block,) = re.findall(r"^```\w*\nsrc/pianomime/[^\n]*\n(.*?)^```", text, re.M | re.S)
    paths: set[str] = set()
    folders: list[tuple[int, str]] = []
    for line in block.splitlines():
        match = re.fullmatch(r"( +)([\w.]+/?) {2,}(\S.*)", line)
        assert match is not None, f"not a name and a description: {line!r}"
        depth, name = len(match[1]), match[2]
        while folders and folders[-1][0] >= depth:
            folders.pop()
        path = "".join(folder for _, folder in folders) + name
        assert path not in paths, f"{path} is there twice"
        paths.add(path)
        if name.endswith("/"):
            folders.append((depth, name))
    return paths


def test_the_tree_in_the_documentation_is_the_tree_on_disk() -> None:
    files = [
        file.relative_to(SOURCE)
        for file in SOURCE.rglob("*.py")
        if file.name not in ("__init__.py", "__main__.py")
    ]
    folders = {f"{parent}/" for file in files for parent in file.parents if parent != Path()}
    there = {file.as_posix() for file in files} | folders
    written = documented_tree()
    assert written - there == set(), "in docs/architecture.md, but not on disk"
    assert there - written == set(), "on disk, but not in docs/architecture.md"

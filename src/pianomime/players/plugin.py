"""Players that others bring: factories by their place, and the files that such a player may use."""

from __future__ import annotations

import importlib
import os
import site
import sys
import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from pianomime.errors import InputError
from pianomime.players.settings import PlayerFactory
from pianomime.policies.methods import bundled_weights, weights_folder


def import_factory(place: str) -> PlayerFactory:
    """The factory at "package.module:factory".

    Args:
        place: the importable module, also one in the present folder, and the name in it.

    Raises:
        InputError: there is none, or its module fails; the message is one line.
    """
    module, _, name = place.partition(":")
    if "/" in module or module.endswith(".py"):
        plain = Path(module).stem
        raise InputError(f"{place}: name the module, not its file, such as {plain}:{name}")
    # A file in the present folder will do, also for the command line. It comes last, so that
    # nothing in that folder hides a library.
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    with one_line(place):
        factory: Any = importlib.import_module(module)
        for part in name.split("."):
            factory = getattr(factory, part)
    if not callable(factory):
        raise InputError(f"{place}: cannot be called to make a player")
    made: PlayerFactory = factory
    return made


@contextmanager
def one_line(place: str) -> Iterator[None]:
    """Whatever goes wrong in the code of others, in one line.

    Raises:
        InputError: something did; the message has the kind of error and where it was raised.
    """
    try:
        yield
    except (InputError, OSError):
        raise
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        where = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}"
        raise InputError(f"{place}: {type(error).__name__}: {error} ({where})") from error


def plugin_files(place: str) -> list[Path]:
    """Every file that may decide how a player of others plays.

    These are all Python files of the package that its module is part of, or for a module alone
    those of its folder; those of all other modules that are imported and belong to no library; and
    the weights, which the player may use through ours. Data files that its code reads are not
    known.

    Args:
        place: "package.module:factory".

    Raises:
        InputError: there is no such module, or it fails.
    """
    module = place.partition(":")[0]
    import_factory(place)
    top = sys.modules[module.partition(".")[0]]
    folders = [Path(each) for each in getattr(top, "__path__", [])]
    files = {file for folder in folders for file in folder.rglob("*.py")}
    if not folders and top.__file__:
        files |= set(Path(top.__file__).parent.glob("*.py"))
    for name in sorted(_reachable(module)):
        file = getattr(sys.modules[name], "__file__", None)
        if file and not _is_library(Path(file)):
            files.add(Path(file))
    # Ours complete a folder that has one of two levels.
    weights = {
        file for home in (weights_folder(), bundled_weights()) for file in home.glob("*.onnx")
    }
    return [*sorted(files), *sorted(weights)]


def _reachable(module: str) -> set[str]:
    """Names of the modules that a module refers to, directly or through others."""
    found, waiting = {module}, [module]
    while waiting:
        for value in list(vars(sys.modules[waiting.pop()]).values()):
            attribute = "__name__" if isinstance(value, ModuleType) else "__module__"
            name = getattr(value, attribute, None)
            if not isinstance(name, str) or name in found or name not in sys.modules:
                continue
            found.add(name)
            file = getattr(sys.modules[name], "__file__", None)
            if file and not _is_library(Path(file)):
                waiting.append(name)
    return found


def _is_library(file: Path) -> bool:
    """Whether a file belongs to Python, to an installed package or to this one."""
    return any(file.is_relative_to(folder) for folder in _library_folders())


def _library_folders() -> list[Path]:
    paths = sysconfig.get_paths()
    folders = [paths["stdlib"], paths["platstdlib"], paths["purelib"], paths["platlib"]]
    ours = Path(__file__).parents[1]
    return [*map(Path, folders), *map(Path, site.getsitepackages()), ours]

"""What a learning command needs, checked at once: before long imports, and before any work.

A look at the files decides: whether they are there, and what kind of thing they are. Reading them
whole, later, finds what is damaged.
"""

from __future__ import annotations

import tempfile
import warnings
import zipfile
from collections.abc import Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path

from pianomime.commands.extras import extra
from pianomime.errors import InputError, closest
from pianomime.learn.data.format import (
    is_data_set,
    training_songs,
    why_no_data_set,
    zarr_attributes,
)
from pianomime.learn.goal.config import RESULT
from pianomime.songs import names
from pianomime.songs.find import find_song, find_songs

TRAIN = (
    "accelerate",
    "diffusers",
    "gymnasium",
    "onnx",
    "onnxruntime",
    "safetensors",
    "sb3_contrib",
    "stable_baselines3",
    "tensorboard",
    "torch",
    "zarr",
)
"""The packages of the extra "train"."""
RAY = ("ray",)
"""What the extra "scale" adds to them."""

_MAKES_DATA = (
    "`pianomime collect-dagger DEMOS -o DATA` makes a data set of demonstrations, "
    "`pianomime perform MIDI_FOLDER -o DATA` one of songs"
)
_MAKES_DEMOS = (
    "`pianomime import-demos` makes demonstrations of the published data, `pianomime retarget` one "
    "of a video"
)


def need_packages(name: str, packages: Iterable[str] = TRAIN) -> None:
    """Refuse to begin where a package is not installed; none is imported.

    Args:
        name: of the extra that they belong to.
        packages: that are needed.

    Raises:
        InputError: one is missing; the message says how to install it.
    """
    with extra(name):
        for package in packages:
            if find_spec(package) is None:
                raise ModuleNotFoundError(f"No module named {package!r}", name=package)


def need_songs(folders: Sequence[Path], least: int = 1) -> None:
    """Refuse folders with too few songs.

    Args:
        folders: of MIDI files; also files, and names of bundled songs, but no parts of such.
        least: number of songs that are needed.

    Raises:
        InputError: none is named, one is not there or holds no song, or there are too few.
    """
    if not folders:
        raise InputError("FOLDER is missing: name folders of MIDI files")
    with warnings.catch_warnings():
        # What is passed over is told when they are read.
        warnings.simplefilter("ignore")
        number = len(find_songs(folders))
    for folder in folders:
        # A folder that was mistyped may be a part of a bundled song's name.
        if not folder.exists() and str(folder) not in names():
            hint = closest(str(folder), names())
            raise InputError(f"{folder}: no such folder, file or bundled song{hint}")
    if number < least:
        raise InputError(
            f"{least} songs at least are needed, some of them for validation; there are {number}"
        )


def need_piece(name: str) -> None:
    """Refuse what is neither a song nor a demonstration.

    Args:
        name: a demonstration (.npz), a MIDI file, or the name of a bundled song.

    Raises:
        InputError: it is none of these.
    """
    if Path(name).suffix == ".npz":
        if not zipfile.is_zipfile(name):
            there = "not a demonstration" if Path(name).exists() else "does not exist"
            raise InputError(f"{name}: {there}; {_MAKES_DEMOS}")
    elif Path(name).is_dir():
        raise InputError(f"{name}: is a folder; many songs: `pianomime train-experts {name}`")
    else:
        find_song(name)


def need_folder(out: Path) -> None:
    """Refuse a folder for results that cannot be made or written.

    Raises:
        InputError: there is a file at the place or above it, or it cannot be written.
    """
    home = out.absolute()
    while not home.exists():
        home = home.parent
    if not home.is_dir():
        raise InputError(f"{home}: is a file; a folder is needed")
    try:
        # What the permissions say is not all: a file system may be read-only, or full.
        tempfile.TemporaryDirectory(prefix=".pianomime-", dir=home).cleanup()
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error.strerror or error}") from error


def need_demonstrations(source: Path) -> None:
    """Refuse what cannot be demonstrations.

    Args:
        source: a folder of demonstrations, one demonstration (.npz), or published ones (.npz).

    Raises:
        InputError: it is not there, or something else; the message says what makes it.
    """
    if not source.exists():
        raise InputError(f"{source}: does not exist; {_MAKES_DEMOS}")
    if source.is_dir():
        if not demonstration_files(source):
            if zarr_attributes(source) is not None or next(source.rglob(".zgroup"), None):
                raise InputError(
                    f"{source}: is a zarr data set, not a folder of demonstrations; if it is the "
                    f"published one: `pianomime import-demos {source} -o demos`"
                )
            raise InputError(f"{source}: holds no demonstrations (.npz); {_MAKES_DEMOS}")
    elif not zipfile.is_zipfile(source):
        raise InputError(f"{source}: not a file of demonstrations (.npz); {_MAKES_DEMOS}")


def demonstration_files(folder: Path) -> list[Path]:
    """The files in a folder or below it that are named as demonstrations are; there may be none."""
    from pianomime.songs.find import files_below

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # They are told where the files are read.
        try:
            return files_below(folder, (".npz",), "demonstrations")
        except InputError:
            return []


def need_experts(path: Path) -> None:
    """Refuse what is neither the run of an expert nor a folder of such.

    Raises:
        InputError: it is not there, or something else, or nothing was trained in it yet.
    """
    # After `need_packages`: these need safetensors.
    from pianomime.learn.expert.expert_run import ExpertRun, find_expert_runs

    if not path.is_dir():
        there = "not the folder of a run" if path.exists() else "does not exist"
        raise InputError(f"{path}: {there}; `pianomime train-expert` and `train-experts` make runs")
    for folder in find_expert_runs(path):
        run = ExpertRun.load(folder)
        if not run.folder.has_result:
            raise InputError(f"{folder}: nothing was trained in this run yet")


def need_data_sets(paths: Sequence[Path]) -> None:
    """Refuse what are no data sets of `pianomime collect`, `collect-dagger` or `perform`.

    Raises:
        InputError: one is not there, or something else, and the message says what makes it; or
            there is but one song in them, and nothing to validate on.
    """
    if not paths:
        raise InputError(f"no data sets are named; {_MAKES_DATA}")
    for path in paths:
        _need_data_set(path)
    songs = {key: name for path in paths for key, name in training_songs(path).items()}
    if len(songs) == 1:
        raise InputError(
            "two songs at least are needed, one of them for validation; there is "
            f"{', '.join(songs.values())} alone"
        )


def _need_data_set(path: Path) -> None:
    # After `need_packages`: it needs safetensors.
    from pianomime.learn.runs.run import is_run

    if not path.exists():
        raise InputError(f"{path}: does not exist; {_MAKES_DATA}")
    if is_data_set(path):
        return
    if path.is_dir() and any(map(is_run, [path, *path.glob("*/")])):
        raise InputError(
            f"{path}: holds runs, not a data set; `pianomime collect {path} -o DATA` makes one of "
            "what their experts play"
        )
    raise InputError(f"{path}: {why_no_data_set(path)}; {_MAKES_DATA}")


def need_place_for_data_set(out: Path) -> None:
    """Refuse a place at which no data set can be written.

    Raises:
        InputError: there is something else than an older data set, or it cannot be written.
    """
    if out.exists() and not is_data_set(out):
        raise InputError(f"{out}: holds something else than a data set; name another place")
    need_folder(out.absolute().parent)


def need_goal_encoder(folder: Path, policy: str) -> None:
    """Refuse to train a policy whose goal encoder is not there.

    Args:
        folder: of the goal encoder.
        policy: name of the policy.

    Raises:
        InputError: it is not there; the message says what makes it.
    """
    from pianomime.learn.runs.run import is_run

    if not (folder / RESULT).is_file():
        begun = "is not trained to the end" if is_run(folder) else "is not there"
        raise InputError(
            f"{policy} needs a goal encoder, and {folder} {begun}: train it with `pianomime "
            f"train-goal MIDI_FOLDER -o {folder}`, or name its folder with --goal"
        )

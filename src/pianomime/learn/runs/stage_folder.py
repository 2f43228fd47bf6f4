"""The folder of a stage that learns by playing songs."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pianomime.learn.runs.fit_folder import FitFolder
from pianomime.learn.runs.lock import run_lock

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@contextmanager
def stage_folder(
    out: Path, stage: str, config: DataclassInstance, songs: Sequence[Path]
) -> Iterator[tuple[FitFolder, Path]]:
    """Begin the training of a stage, or go on with it; nobody else may meanwhile.

    Yields its folder, and where its result belongs.

    Args:
        out: folder for both.
        stage: its name.
        config: how it is trained.
        songs: files that it learns from.

    Raises:
        InputError: the folder holds another training, or is used by another process.
        OSError: a song cannot be read, or the folder cannot be written.
    """
    digest = hashlib.sha256()
    for song in songs:
        digest.update(song.read_bytes())
    about: dict[str, Any] = {
        "stage": stage,
        **dataclasses.asdict(config),
        "data": digest.hexdigest()[:16],
    }
    path = out / stage
    path.mkdir(parents=True, exist_ok=True)
    with run_lock(path):
        yield FitFolder.open(path, about), out / f"{stage}.onnx"

"""The folder of a run: what was trained on, how, how far it is, and what came out best."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.files import atomic, leftovers, sweep
from pianomime.learn.expert.config import ExpertConfig, differences, from_json, to_json
from pianomime.learn.runs.safetensors_file import Arrays, read_tensors, write_tensors
from pianomime.plan.demonstration import Demonstration

VERSION = 1

_ABOUT = "run.json"
_SONG = "song.npz"
_STATE = "state.safetensors"
_BEST = "expert.safetensors"
_CURVE = "curve.json"
_FILES = (_ABOUT, _SONG, _STATE, _BEST, _CURVE)


@dataclass(frozen=True)
class Evaluation:
    """How well a song is played after some training.

    Attributes:
        steps: control steps spent by then.
        precision, recall, f1: of the deterministic performance.
    """

    steps: int
    precision: float
    recall: float
    f1: float


@dataclass(frozen=True)
class RunFolder:
    """A run, on disk.

    Attributes:
        path: of the folder.
        song: what it is about, in an excerpt.
        config: how it is trained.
        start, seconds: the excerpt [s].
    """

    path: Path
    song: Demonstration
    config: ExpertConfig
    start: float
    seconds: float

    @classmethod
    def open(
        cls, path: Path, song: Demonstration, config: ExpertConfig, start: float, seconds: float
    ) -> RunFolder:
        """Begin a run, or go on with one of the same song and config.

        Only the steps may be other ones: more of them prolong a run. What a kill or a full disk
        left of one that was only being begun is begun anew. No other process may be writing here.

        Raises:
            InputError: the folder holds another run, or something else.
            OSError: it cannot be written.
        """
        if not (path / _ABOUT).exists():
            if path.is_file():
                raise InputError(f"{path}: is a file; a folder is needed")
            path.mkdir(parents=True, exist_ok=True)
            left = {file.name for file in path.iterdir()} - {*leftovers(path, _FILES)}
            # The song comes first; another one of that name is somebody's.
            if left and not (
                left == {_SONG} and _same_song(Demonstration.load(path / _SONG), song)
            ):
                raise InputError(f"{path}: holds something else than a run; name another folder")
            sweep(path, _FILES)
            if not left:
                song.save(path / _SONG)
            run = cls(path, song, config, start, seconds)
            run._write_about()
            return run
        there = cls.load(path)
        if not _same_song(there.song, song):
            raise InputError(f"{path}: holds a run on another song, {there.song.score.title}")
        longer = replace(there.config, steps=config.steps)
        if longer != config:
            odd = ", ".join(differences(to_json(longer), to_json(config)))
            raise InputError(
                f"{path}: holds a run with other settings ({odd}); name another folder"
            )
        sweep(path, _FILES)
        run = replace(there, config=config)
        run._write_about()
        return run

    @classmethod
    def load(cls, path: Path) -> RunFolder:
        """A run that is there.

        Raises:
            InputError: there is none, or one of another version.
        """
        try:
            about = json.loads((path / _ABOUT).read_text(encoding="utf-8"))
            version = about["run_version"]
        except (FileNotFoundError, NotADirectoryError):
            raise InputError(f"{path}: not the folder of a run (it has no {_ABOUT})") from None
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(f"{path / _ABOUT}: damaged, or not that of a run") from error
        if version != VERSION:
            raise InputError(f"{path}: a run of version {version}; this program reads {VERSION}")
        try:
            start, seconds = float(about["start"]), float(about["seconds"])
            config = from_json(ExpertConfig, about["config"])
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(f"{path / _ABOUT}: {error}") from error
        return cls(path, Demonstration.load(path / _SONG), config, start, seconds)

    @property
    def tensorboard(self) -> Path:
        """Folder of the logs."""
        return self.path / "tensorboard"

    @property
    def finished(self) -> bool:
        """Whether all its steps were spent."""
        return self.steps_done >= self.config.steps

    @property
    def steps_done(self) -> int:
        """Control steps that were spent."""
        curve = self.curve()
        return curve[-1].steps if curve else 0

    def curve(self) -> list[Evaluation]:
        """All evaluations so far.

        Raises:
            InputError: the file is damaged.
        """
        state = self.state()
        return [] if state is None else [Evaluation(**row) for row in state[1]["curve"]]

    def state(self) -> tuple[Arrays, dict[str, Any]] | None:
        """Arrays and facts to go on from; None before the first checkpoint.

        Raises:
            InputError: the file is damaged.
        """
        return read_tensors(self.path / _STATE) if (self.path / _STATE).exists() else None

    def best(self) -> tuple[Arrays, dict[str, Any]]:
        """The best expert so far.

        Raises:
            InputError: there is none yet, or the file is damaged.
        """
        if not (self.path / _BEST).exists():
            raise InputError(f"{self.path}: nothing was trained in this run yet")
        return read_tensors(self.path / _BEST)

    def keep_best(self, arrays: Arrays, evaluation: Evaluation) -> None:
        """Keep an expert that is better than those before."""
        write_tensors(self.path / _BEST, arrays, vars(evaluation))

    def checkpoint(self, arrays: Arrays, about: dict[str, Any], curve: list[Evaluation]) -> None:
        """Keep everything that is needed to go on, and the curve for people to read.

        Raises:
            OSError: the disk is full; the checkpoint before stays.
        """
        rows = [vars(evaluation) for evaluation in curve]
        write_tensors(self.path / _STATE, arrays, {**about, "curve": rows})
        with atomic(self.path / _CURVE) as temporary:
            temporary.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")

    def _write_about(self) -> None:
        about = {
            "run_version": VERSION,
            "song": self.song.score.title,
            "start": self.start,
            "seconds": self.seconds,
            "config": to_json(self.config),
        }
        with atomic(self.path / _ABOUT) as temporary:
            temporary.write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")


def is_run(path: Path) -> bool:
    """Whether a folder is that of a run."""
    return (path / _ABOUT).is_file()


def find_runs(path: Path) -> list[Path]:
    """The run in a folder, or the runs with an expert in the folders below it, in order.

    Raises:
        InputError: there are none.
    """
    if is_run(path):
        return [path]
    found = sorted(about.parent for about in path.glob(f"*/{_ABOUT}"))
    found = [folder for folder in found if (folder / _BEST).exists()]
    if not found:
        raise InputError(f"{path}: no run, nor a folder of runs with experts")
    return found


def _same_song(one: Demonstration, other: Demonstration) -> bool:
    mine, theirs = one.plan, other.plan
    return bool(
        mine.fingertips.shape == theirs.fingertips.shape
        and (mine.fingertips == theirs.fingertips).all()
        and (mine.finger_key == theirs.finger_key).all()
        and (one.score.roll() == other.score.roll()).all()
    )

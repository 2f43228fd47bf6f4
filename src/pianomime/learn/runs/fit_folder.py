"""The folder of a network in training: what it depends on, how far it is, and the result."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.files import atomic, leftovers, sweep
from pianomime.learn.expert.config import differences
from pianomime.learn.imitation.trainer_config import FREE
from pianomime.learn.runs.safetensors_file import Arrays, read_tensors, write_tensors

VERSION = 1

_CONFIG = "config.json"
_STATE = "state.safetensors"
_WEIGHTS = "weights.safetensors"
_FILES = (_CONFIG, _STATE, _WEIGHTS)


class FitFolder:
    """A training, on disk.

    Attributes:
        path: of the folder.
        config: all that the weights depend on, as JSON has it.
    """

    def __init__(self, path: Path) -> None:
        """A training that is there.

        Raises:
            InputError: there is none, or one of another version.
        """
        try:
            about = json.loads((path / _CONFIG).read_text(encoding="utf-8"))
            version = about.pop("fit_version")
        except (FileNotFoundError, NotADirectoryError):
            raise InputError(f"{path}: no network was trained here (no {_CONFIG})") from None
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path / _CONFIG}: damaged, or not that of a network") from error
        if version != VERSION:
            raise InputError(
                f"{path}: a network of version {version}; this program reads {VERSION}"
            )
        self.path = path
        self.config: dict[str, Any] = about

    @classmethod
    def open(cls, path: Path, config: dict[str, Any]) -> FitFolder:
        """Begin a training, or go on with one of the same config.

        No other process may be writing here.

        Args:
            path: of the folder, which must exist.
            config: all that the weights depend on; how to train is in "fit". Only what cannot
                change the weights may be another than before. That excludes the number of steps,
                on which the learning rate of every step depends.

        Raises:
            InputError: the folder holds another training, or something else.
            OSError: it cannot be written.
        """
        config = json.loads(json.dumps(config))
        if not (path / _CONFIG).exists():
            if {file.name for file in path.iterdir()} - {*leftovers(path, _FILES)}:
                raise InputError(f"{path}: holds something else; name another folder")
            with atomic(path / _CONFIG) as temporary:
                about = json.dumps({"fit_version": VERSION, **config}, indent=2) + "\n"
                temporary.write_text(about, encoding="utf-8")
        there = cls(path)
        odd = differences(_binding(there.config), _binding(config))
        if odd:
            raise InputError(
                f"{path}: holds a network trained otherwise ({', '.join(odd)}); name another folder"
            )
        sweep(path, _FILES)
        return there

    @property
    def tensorboard(self) -> Path:
        """Folder of the logs."""
        return self.path / "tensorboard"

    @property
    def finished(self) -> bool:
        """Whether the result is there."""
        return (self.path / _WEIGHTS).exists()

    def state(self) -> tuple[Arrays, int] | None:
        """What to go on from, and the steps done by then; None before the first checkpoint.

        Raises:
            InputError: the file is damaged.
        """
        if not (self.path / _STATE).exists():
            return None
        arrays, about = read_tensors(self.path / _STATE)
        if "steps" not in about:
            raise InputError(f"{self.path / _STATE}: not a checkpoint of a training")
        return arrays, int(about["steps"])

    def checkpoint(self, arrays: Arrays, steps: int) -> None:
        """Keep everything that is needed to go on.

        Raises:
            OSError: the disk is full; the checkpoint before stays.
        """
        write_tensors(self.path / _STATE, arrays, {"steps": steps})

    def finish(self, weights: Arrays, measured: dict[str, float]) -> None:
        """Keep the result, and what its evaluation gave.

        Raises:
            OSError: the disk is full.
        """
        write_tensors(self.path / _WEIGHTS, weights, {"fit_version": VERSION, "measured": measured})

    def weights(self) -> tuple[Arrays, dict[str, float]]:
        """The result, and what its evaluation gave.

        Raises:
            InputError: the training is not finished, or the file is damaged.
        """
        if not self.finished:
            raise InputError(f"{self.path}: this network is not trained to the end yet")
        arrays, about = read_tensors(self.path / _WEIGHTS)
        if about.get("fit_version") != VERSION:
            raise InputError(f"{self.path / _WEIGHTS}: of another version of this program")
        return arrays, about["measured"]


def _binding(config: dict[str, Any]) -> dict[str, Any]:
    fit = {name: value for name, value in config.get("fit", {}).items() if name not in FREE}
    return {**config, "fit": fit}

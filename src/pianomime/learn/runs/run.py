"""The folder of a training run: its config, its last checkpoint, its result and its logs.

Every training of the house, of experts and of networks, is such a folder. All files are written
whole or not at all, so that a run that is killed at any instant is resumed from its checkpoint.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from pianomime.errors import InputError
from pianomime.files import atomic
from pianomime.learn.runs.config_json import differences
from pianomime.learn.runs.safetensors_file import Arrays, read_tensors, write_tensors
from pianomime.schema import Field, check_json
from pianomime.sealed_json import read_json, sealed, unsealed
from pianomime.staging import hold, is_staging

VERSION = 3
"""Of the folder's files; version 2 had no digests, version 1 other names."""

_CONFIG = "run.json"
_STATE = "state.safetensors"
_RESULT = "result.safetensors"
_SCHEMA = {"run_version": Field("int"), "kind": Field("text"), "config": Field("object")}
_CHECKPOINT = {"steps": Field("int", (), 0), "metadata": Field("object")}
_PATIENCE = 10.0
"""[s] for a process that was stopped, or whose node is lost, to be gone."""


class Checkpoint(NamedTuple):
    """What a training goes on from.

    Attributes:
        arrays: weights, moments of optimizers and states of environments, by name.
        steps: that were done by then.
        metadata: anything else, as JSON.
    """

    arrays: Arrays
    steps: int
    metadata: dict[str, Any]


class RunFolder:
    """The folder of a training run.

    Attributes:
        path: of the folder.
        kind: what is trained, such as "expert" or "network".
        config: everything that the result depends on, as JSON.
    """

    def __init__(self, path: Path, kind: str, config: dict[str, Any]) -> None:
        self.path, self.kind, self.config = path, kind, config

    @classmethod
    @contextmanager
    def open(
        cls,
        path: Path,
        kind: str,
        config: Mapping[str, Any],
        may_differ: Collection[str] = (),
    ) -> Iterator[RunFolder]:
        """Begin a run, or resume one of the same config; nobody else trains there meanwhile.

        A folder in which nothing was trained yet takes any config.

        What a kill or a full disk left of files that were being written is removed.

        Args:
            path: of the folder; made if need be.
            kind: what is trained.
            config: everything that the result depends on; for JSON.
            may_differ: names in the config, such as "trainer.evaluate_every", whose values may be
                others than before; from now on those given hold.

        Raises:
            InputError: the folder holds another run or something else, or another process holds it.
            OSError: it cannot be written.
        """
        given: dict[str, Any] = json.loads(json.dumps(config))
        if path.is_file():
            raise InputError(f"{path}: is a file; a folder is needed")
        path.mkdir(parents=True, exist_ok=True)
        with hold(path, _PATIENCE):
            if (path / _CONFIG).exists():
                there = cls.load(path)
                if there.kind != kind:
                    raise InputError(
                        f"{path}: holds a run that trains another kind of thing ({there.kind}, "
                        f"not {kind}); name another folder"
                    )
                odd = differences(_without(there.config, may_differ), _without(given, may_differ))
                # A run in which nothing was trained yet may become one of other settings.
                if odd and there.begun:
                    raise InputError(
                        f"{path}: holds a run with other settings ({', '.join(odd)}); "
                        "name another folder"
                    )
            elif any(not is_staging(file.name) for file in path.iterdir()):
                raise InputError(f"{path}: holds something else than a run; name another folder")
            run = cls(path, kind, given)
            content = sealed({"run_version": VERSION, "kind": kind, "config": given})
            with atomic(path / _CONFIG) as temporary:
                temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
            yield run

    @classmethod
    def load(cls, path: Path) -> RunFolder:
        """A run that is there, to be read.

        Raises:
            InputError: there is none, it is damaged, or of another version.
        """
        refusal = f"{path / _CONFIG}: damaged, or not that of a run"
        try:
            content = read_json(path / _CONFIG)
            version = content["run_version"]
            if version == VERSION:
                content = unsealed(content, _SCHEMA)
        except (FileNotFoundError, NotADirectoryError):
            raise InputError(f"{path}: not the folder of a run (it has no {_CONFIG})") from None
        except InputError as error:
            raise InputError(f"{refusal} ({error})") from error
        except (OSError, LookupError, TypeError) as error:
            raise InputError(refusal) from error
        if version != VERSION:
            raise InputError(f"{path}: a run of version {version}; this program reads {VERSION}")
        return cls(path, content["kind"], content["config"])

    @property
    def tensorboard(self) -> Path:
        """Folder of the logs."""
        return self.path / "tensorboard"

    def state(self) -> Checkpoint | None:
        """The last checkpoint; None before the first.

        Raises:
            InputError: the file is damaged.
        """
        path = self.path / _STATE
        if not path.exists():
            return None
        arrays, content = read_tensors(path)
        try:
            check_json(content, _CHECKPOINT)
        except InputError as error:
            raise InputError(
                f"{path}: damaged, or not the checkpoint of a run ({error})"
            ) from error
        return Checkpoint(arrays, content["steps"], content["metadata"])

    def checkpoint(
        self, arrays: Arrays, steps: int, metadata: Mapping[str, Any] | None = None
    ) -> None:
        """Keep everything that is needed to go on.

        Args:
            arrays: by name.
            steps: that were done.
            metadata: anything else, for JSON.

        Raises:
            OSError: the disk is full; the checkpoint before stays.
        """
        content = {"steps": steps, "metadata": dict(metadata or {})}
        write_tensors(self.path / _STATE, arrays, content)

    @property
    def begun(self) -> bool:
        """Whether there is anything that was trained."""
        return (self.path / _STATE).exists() or self.has_result

    @property
    def has_result(self) -> bool:
        """Whether there is a result."""
        return (self.path / _RESULT).exists()

    def result(self) -> tuple[Arrays, dict[str, Any]]:
        """The result, and how it was measured.

        Raises:
            InputError: there is none yet, or the file is damaged.
        """
        if not self.has_result:
            raise InputError(f"{self.path}: this run has no result yet")
        return read_tensors(self.path / _RESULT)

    def keep_result(self, arrays: Arrays, measured: Mapping[str, Any]) -> None:
        """Keep the result in place of any before.

        Args:
            arrays: by name.
            measured: what its evaluation gave, for JSON.

        Raises:
            OSError: the disk is full; the result before stays.
        """
        write_tensors(self.path / _RESULT, arrays, dict(measured))


def is_run(path: Path) -> bool:
    """Whether a folder is that of a run."""
    return (path / _CONFIG).is_file()


def _without(config: dict[str, Any], names: Collection[str]) -> dict[str, Any]:
    """A config without the settings of these names, such as "trainer.evaluate_every"."""
    left = copy.deepcopy(config)
    for name in names:
        *groups, last = name.split(".")
        group: Any = left
        for each in groups:
            group = group.get(each) if isinstance(group, dict) else None
        if isinstance(group, dict):
            group.pop(last, None)
    return left

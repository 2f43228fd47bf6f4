"""The run of an expert: a run folder with the demonstration, the curve and the best expert."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.files import atomic
from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.runs.config_json import from_json, to_json
from pianomime.learn.runs.run import Checkpoint, RunFolder, is_run
from pianomime.learn.runs.safetensors_file import Arrays
from pianomime.plan.demonstration import Demonstration
from pianomime.schema import Field, ListOf, check_json
from pianomime.world.layout import LAYOUT

_KIND = "expert"
_DEMONSTRATION = "demonstration.npz"
_CURVE = "curve.json"
_EXCERPT = "excerpt"
"""Name, in the run's config, of what is known of the demonstration."""
_EXCERPT_SCHEMA = {
    "title": Field("text"),
    "start": Field("float", (), 0),
    "seconds": Field("float", (), 0, may_be_infinite=True),
    "digest": Field("text"),
}
_SCORE = Field("float", (), 0, 1)
_EVALUATION = {
    "steps": Field("int", (), 0),
    **dict.fromkeys(("precision", "recall", "f1"), _SCORE),
}
"""Schema of an `Evaluation`."""
_MAY_DIFFER = ("total_steps", f"{_EXCERPT}.title", f"{_EXCERPT}.start", f"{_EXCERPT}.seconds")
"""More steps prolong a run; of the excerpt its content counts."""


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
class ExpertRun:
    """The run of an expert, on disk.

    Attributes:
        folder: its files.
        demonstration: the excerpt of the demonstration that it is trained on.
        config: how it is trained.
        start, seconds: where the excerpt begins, and its length at most [s].
    """

    folder: RunFolder
    demonstration: Demonstration
    config: ExpertConfig
    start: float
    seconds: float

    @classmethod
    @contextmanager
    def open(
        cls,
        path: Path,
        demonstration: Demonstration,
        config: ExpertConfig,
        start: float,
        seconds: float,
    ) -> Iterator[ExpertRun]:
        """Begin a run, or resume one of the same demonstration and config; it is locked meanwhile.

        The total number of steps may be another: a larger one prolongs a run.

        Raises:
            InputError: the folder holds another run or something else, or another process holds it.
            OSError: it cannot be written.
        """
        excerpt = {
            "title": demonstration.score.title,
            "start": start,
            "seconds": seconds,
            "digest": _digest(demonstration),
        }
        if is_run(path):
            run = RunFolder.load(path)
            there = run.config.get(_EXCERPT)
            if run.begun and isinstance(there, dict) and there.get("digest") != excerpt["digest"]:
                raise InputError(
                    f"{path}: holds a run on another song, or another part of it "
                    f"({there.get('title')}); name another folder"
                )
        content = {_EXCERPT: excerpt, **to_json(config)}
        with RunFolder.open(path, _KIND, content, _MAY_DIFFER) as folder:
            # One that is there may be of another song, on which nothing was trained.
            if not folder.begun or not (path / _DEMONSTRATION).exists():
                demonstration.save(path / _DEMONSTRATION)
            yield cls(folder, demonstration, config, start, seconds)

    @classmethod
    def load(cls, path: Path) -> ExpertRun:
        """The run of an expert that is there, to be read.

        Raises:
            InputError: there is none, it is damaged, or of another version.
        """
        folder = RunFolder.load(path)
        content = dict(folder.config)
        excerpt = content.pop(_EXCERPT, None)
        if folder.kind != _KIND or not isinstance(excerpt, dict):
            raise InputError(
                f"{path}: not the run of an expert; if it trains a policy, name the folder above, "
                "which holds its .onnx file"
            )
        try:
            check_json(excerpt, _EXCERPT_SCHEMA)
            config = from_json(ExpertConfig, content)
        except InputError as error:
            raise InputError(f"{path}: its config cannot be read ({error})") from error
        if not (path / _DEMONSTRATION).exists():
            raise InputError(f"{path}: nothing was trained in this run yet")
        demonstration = Demonstration.load(path / _DEMONSTRATION)
        if _digest(demonstration) != excerpt["digest"]:
            raise InputError(f"{path / _DEMONSTRATION}: not the demonstration of this run")
        return cls(folder, demonstration, config, excerpt["start"], excerpt["seconds"])

    @property
    def path(self) -> Path:
        """Path of the folder."""
        return self.folder.path

    @property
    def tensorboard(self) -> Path:
        """Folder of the logs."""
        return self.folder.tensorboard

    @property
    def finished(self) -> bool:
        """Whether all its steps were spent."""
        return self.steps_done >= self.config.total_steps

    @property
    def steps_done(self) -> int:
        """Control steps spent by the last evaluation."""
        curve = self.curve()
        return curve[-1].steps if curve else 0

    def curve(self) -> list[Evaluation]:
        """All evaluations so far.

        Raises:
            InputError: the file is damaged.
        """
        state = self.state()
        if state is None:
            return []
        try:
            check_json(state.metadata, {"curve": ListOf(_EVALUATION)})
        except InputError as error:
            raise InputError(f"{self.path}: its curve cannot be read ({error})") from error
        return [Evaluation(**row) for row in state.metadata["curve"]]

    def state(self) -> Checkpoint | None:
        """The last checkpoint, with the `curve`; None before the first.

        Raises:
            InputError: the file is damaged.
        """
        return self.folder.state()

    def checkpoint(self, arrays: Arrays, steps: int, curve: list[Evaluation]) -> None:
        """Keep everything that is needed to go on, and the curve for people to read.

        Raises:
            OSError: the disk is full; the checkpoint before stays.
        """
        rows = [vars(evaluation) for evaluation in curve]
        self.folder.checkpoint(arrays, steps, {"curve": rows})
        with atomic(self.path / _CURVE) as temporary:
            temporary.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")

    def best(self) -> tuple[Arrays, dict[str, Any]]:
        """The best expert so far, and its evaluation.

        Raises:
            InputError: there is none yet, or the file is damaged.
        """
        if not self.folder.has_result:
            raise InputError(f"{self.path}: nothing was trained in this run yet")
        arrays, measured = self.folder.result()
        try:
            check_json(measured, _EVALUATION)
        except InputError as error:
            raise InputError(f"{self.path}: its result cannot be read ({error})") from error
        return arrays, measured

    def controls_among(self, arrays: Arrays) -> NDArray[np.float64]:
        """(T, 46) the controls of a trajectory search [rad, m].

        Args:
            arrays: of the best expert or of a checkpoint.

        Raises:
            InputError: there are none that fit the demonstration.
        """
        ctrl = arrays.get("ctrl")
        wanted = len(self.demonstration.plan), LAYOUT.ctrl_size
        if ctrl is None or ctrl.shape != wanted or ctrl.dtype != np.float64:
            raise InputError(f"{self.path}: the expert's controls do not fit its song")
        return ctrl

    def keep_best(self, arrays: Arrays, evaluation: Evaluation) -> None:
        """Keep an expert that is better than those before.

        Raises:
            OSError: the disk is full; the best before stays.
        """
        self.folder.keep_result(arrays, vars(evaluation))


def find_expert_runs(path: Path) -> list[Path]:
    """The run in a folder, or the runs with an expert in the folders below it, in order.

    Raises:
        InputError: there are none.
    """
    if is_run(path):
        return [path]
    below = [RunFolder.load(folder) for folder in sorted(path.glob("*/")) if is_run(folder)]
    found = [run.path for run in below if run.kind == _KIND and run.has_result]
    if not found:
        raise InputError(f"{path}: no run, nor a folder of runs with experts")
    return found


def _digest(demonstration: Demonstration) -> str:
    """Hash of what an expert is trained on: the plan, and the keys that should be down."""
    digest = hashlib.sha256()
    for array in (
        demonstration.plan.fingertips,
        demonstration.plan.finger_key,
        demonstration.score.roll(),
    ):
        digest.update(f"{array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()[:16]

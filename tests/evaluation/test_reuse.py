"""A result is not reused for another library, weight, setting, seed or piece of code.

Rows are made by a player that plays next to nothing, in this process: only what is reused matters.
"""

from __future__ import annotations

import importlib.metadata
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import made_up
import pianomime
from pianomime import evaluate, songs
from pianomime.evaluation import evaluation
from pianomime.evaluation.summary import summarize
from pianomime.players import casting
from pianomime.policies.methods import WEIGHTS, weights_folder

LAZY = """
from dataclasses import dataclass, field

import numpy as np

from pianomime import FingertipPlan, Player
from pianomime.track import ReplayTracker

REST = 0.0


class Lazy(Player):
    name = "lazy"

    def start(self, score):
        frames = score.frames()
        nobody = np.full(len(score), -1, np.int8)
        idle = np.full((frames, 2, 5), -1, np.int8)
        plan = FingertipPlan(np.zeros((frames, 2, 6, 3)), idle, nobody, nobody)
        return ReplayTracker(np.full((frames, 46), REST)).start(plan)


def make(effort, seed, weights=None, ease=0.5):
    return Lazy()
"""


ROW = summarize(made_up.performance(made_up.score()))


class Counted:
    """Evaluates one song with the same folder, and tells whether it was played."""

    def __init__(self, out: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.played = 0
        self._out = out

        def work(
            function: str, items: list[Path], jobs: int, setup: dict[str, Any], *_: Any
        ) -> Iterator[tuple[Path, dict[str, Any]]]:
            for item in items:
                self.played += 1
                yield item, {**ROW, "effort": setup["effort"]}

        monkeypatch.setattr(evaluation, "work", work)

    def __call__(self, player: str, song: str = "ode-to-joy", **options: Any) -> bool:
        before = self.played
        evaluate(song, player, out=self._out, jobs=1, **options)
        return self.played > before


@pytest.fixture
def plays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Counted:
    return Counted(tmp_path / "out", monkeypatch)


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file of the lazy player, `lazy_player:make`."""
    path = tmp_path / "lazy_player.py"
    path.write_text(LAZY)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield path
    sys.modules.pop("lazy_player", None)


def test_nothing_changed(plays: Counted, module: Path) -> None:
    assert plays("lazy_player:make")
    assert not plays("lazy_player:make")
    assert plays("zero-shot")
    assert not plays("zero-shot")


@pytest.mark.parametrize(
    "options",
    [
        {"effort": 2},
        {"seed": 1},
        {"seconds": 7.0},
        {"settings": {"ease": 0.6}},
        {"settings": {"ease": 0.5}},
    ],
    ids=str,
)
def test_other_options(plays: Counted, module: Path, options: dict[str, Any]) -> None:
    assert plays("lazy_player:make")
    assert plays("lazy_player:make", **options)
    assert not plays("lazy_player:make", **options)
    assert not plays("lazy_player:make")


def test_settings_that_are_written_otherwise_are_the_same(plays: Counted) -> None:
    assert plays("zero-shot", settings={"planner.beam": 90})
    assert not plays("zero-shot", settings={"planner": {"beam": 90}})
    assert plays("zero-shot", settings={"planner": {"beam": 91}})


def test_another_world(plays: Counted) -> None:
    assert plays("zero-shot", world="solid")
    assert not plays("zero-shot", world="solid")
    assert plays("zero-shot", world="paper")
    # Its own is the same world, whether it is asked for or not.
    own = pianomime.load_player("zero-shot").world
    assert plays("zero-shot") == (own not in ("solid", "paper"))


@pytest.mark.parametrize("library", ["daqp", "mujoco", "numpy", "onnxruntime", "scipy"])
def test_another_version_of_a_library(
    plays: Counted, library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert plays("zero-shot")
    version = importlib.metadata.version

    def newer(name: str) -> str:
        return "999.0" if name == library else version(name)

    monkeypatch.setattr(evaluation, "version", newer)
    assert plays("zero-shot")
    assert not plays("zero-shot")
    monkeypatch.setattr(evaluation, "version", version)
    assert not plays("zero-shot")


def test_a_library_that_is_not_installed(plays: Counted, monkeypatch: pytest.MonkeyPatch) -> None:
    assert plays("zero-shot")
    version = importlib.metadata.version

    def without(name: str) -> str:
        if name == "onnxruntime":
            raise importlib.metadata.PackageNotFoundError(name)
        return version(name)

    monkeypatch.setattr(evaluation, "version", without)
    assert plays("zero-shot")
    assert not plays("zero-shot")


@pytest.mark.parametrize("method", ["fingers", "two-stage-diff"])
def test_other_weights(
    plays: Counted, method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a folder of weights, and in the one that a variable of the environment names."""
    weights = tmp_path / "weights"
    shutil.copytree(weights_folder(), weights)
    # The networks are not read: this is about the bytes of their files.
    another = pianomime.load_player("zero-shot")
    monkeypatch.setattr(casting, "load_player", lambda *_, **__: another)
    for player in (f"{weights}/{method}", method):
        monkeypatch.setenv(WEIGHTS, str(weights))
        assert plays(player)
        assert not plays(player)
        for policy in pianomime.policies.methods.METHODS[method]:
            _change_a_byte(weights / f"{policy}.onnx")
            assert plays(player)
            assert not plays(player)


def test_another_factory(plays: Counted, module: Path) -> None:
    assert plays("lazy_player:make")
    module.write_text(LAZY.replace("REST = 0.0", "REST = 0.1"))
    assert plays("lazy_player:make")
    assert not plays("lazy_player:make")


def test_another_song_under_the_same_name(plays: Counted, module: Path, tmp_path: Path) -> None:
    song = tmp_path / "song.mid"
    for name in songs.names()[:2]:
        song.write_bytes(songs.path(name).read_bytes())
        assert plays("lazy_player:make", str(song))
        assert not plays("lazy_player:make", str(song))


@pytest.mark.parametrize(
    "change",
    [
        lambda package: _change_a_byte(package / "world" / "parameters.json"),
        lambda package: _append(package / "plan" / "fingering.py", "# changed\n"),
        lambda package: _append(package / "new.py", "PARTS = 1\n"),
    ],
    ids=["parameters", "code", "file"],
)
def test_other_code_or_parameters(
    plays: Counted,
    change: Callable[[Path], None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    package = tmp_path / "pianomime"
    ours = Path(pianomime.__file__).parent
    for file in ours.rglob("*"):
        if file.suffix in (".py", ".json"):
            copy = package / file.relative_to(ours)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, copy)
    assert plays("zero-shot")
    with monkeypatch.context() as moved:
        moved.setattr(pianomime, "__file__", str(package / "__init__.py"))
        assert not plays("zero-shot")
        (package / "notes.txt").write_text("no code")
        assert not plays("zero-shot")
        change(package)
        assert plays("zero-shot")
        assert not plays("zero-shot")


def test_the_player_in_the_rows_is_not_made_up(module: Path, tmp_path: Path) -> None:
    """The real worker, once: its row is what is stored and reused."""
    results = [
        evaluate("c-major-study", "lazy_player:make", seconds=0.5, jobs=1, out=tmp_path / "out")
        for _ in range(2)
    ]
    assert results[0] == results[1]
    assert results[0]["songs"][0]["player"] == "lazy"
    assert results[0]["mean"]["dropped_notes"] > 0


def _change_a_byte(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def _append(path: Path, text: str) -> None:
    path.write_text((path.read_text() if path.exists() else "") + text)


@pytest.mark.parametrize("reverse", [False, True])
def test_means_are_of_songs_in_their_order_however_they_were_done(
    reverse: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sums depend on it, and a second run after a stop must come to the same."""
    made = [{**ROW, "effort": number} for number in range(len(songs.names()))]
    averaged = []

    def work(function: str, items: list[Path], *_: Any, **__: Any) -> Iterator[Any]:
        done = list(zip(items, made, strict=True))
        yield from reversed(done) if reverse else done

    def mean(rows: list[dict[str, Any]], measures: Any) -> Any:
        averaged.extend(row["effort"] for row in rows)
        return true_mean(rows, measures)

    true_mean = evaluation.mean
    monkeypatch.setattr(evaluation, "work", work)
    monkeypatch.setattr(evaluation, "mean", mean)
    evaluate(songs.names(), "zero-shot", out=tmp_path, jobs=1)
    assert averaged == list(range(len(made)))

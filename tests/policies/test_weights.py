"""The weights that come with the program."""

from __future__ import annotations

import numpy as np
import pytest

from pianomime import Score, excerpt, load_player, songs
from pianomime.policies.methods import WEIGHTS, weights_folder
from pianomime.policies.network_file import load_network


@pytest.fixture(autouse=True)
def shipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """No others."""
    monkeypatch.delenv(WEIGHTS, raising=False)


@pytest.fixture(scope="module")
def score() -> Score:
    """Five seconds that nobody learned from."""
    return excerpt(Score.from_midi(songs.path("bach-prelude-c")), seconds=5)


def test_they_are_small() -> None:
    files = list(weights_folder().glob("*.onnx"))
    assert files
    assert sum(file.stat().st_size for file in files) < 20e6
    assert (weights_folder() / "README.md").is_file()


def test_they_tell_what_they_are() -> None:
    for file in weights_folder().glob("*.onnx"):
        _, info = load_network(file, file.stem)
        assert info.licence
        assert (info.level == "high") == file.stem.startswith("high")
        assert (info.diffusion is not None) == file.stem.endswith("diff")


def test_their_card_begins_with_what_hubs_read() -> None:
    card = (weights_folder() / "README.md").read_text(encoding="utf-8")
    _, head, body = card.split("---\n", 2)
    keys = {line.partition(":")[0] for line in head.splitlines() if not line.startswith((" ", "-"))}
    assert keys >= {"license", "library_name", "tags", "datasets"}
    for file in weights_folder().glob("*.onnx"):
        assert f"`{file.name}`" in body


def test_fingers_add_something() -> None:
    """To what the zero-shot player of frames makes of songs that it did not learn from."""
    some = [
        excerpt(Score.from_midi(songs.path(name)), seconds=12)
        for name in ("beethoven-ode-to-joy", "petzold-minuet-g", "satie-gymnopedie-1")
    ]
    with_it, without = (
        np.mean([load_player(name, 0).play(one).metrics()["f1"] for one in some])
        for name in ("fingers", "zero-shot-20hz")
    )
    assert with_it > without


@pytest.mark.parametrize(
    ("name", "least"), [("fingers", 0.85), ("three-stage", 0.8), ("two-stage-diff", 0.4)]
)
def test_they_play(score: Score, name: str, least: float) -> None:
    first, again = (load_player(name, 0).play(score) for _ in range(2))
    assert first.metrics()["f1"] > least
    np.testing.assert_array_equal(first.ctrl, again.ctrl)


def test_another_seed_draws_otherwise(score: Score) -> None:
    first, other = (load_player("two-stage-diff", 0, seed).play(score) for seed in (0, 1))
    assert not np.array_equal(first.ctrl, other.ctrl)

"""The data sets in `examples/data` are what their README says, and what the program makes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pianomime import cli, songs
from pianomime.keyboard import FRAME_RATE
from pianomime.learn.data.dataset import trajectory_dataset
from pianomime.learn.data.trajectories import TrajectoryData

FOLDER = Path(__file__).parents[3] / "examples" / "data"
NAMES = ("bundled-songs.zarr", "bundled-songs-noisy.zarr")


def test_they_are_ten_minutes_of_all_bundled_songs():
    both = [TrajectoryData.open(FOLDER / name) for name in NAMES]
    assert sum(int(data.ends[-1]) for data in both) / FRAME_RATE >= 600
    readme = (FOLDER / "README.md").read_text("utf-8")
    for name, data in zip(NAMES, both, strict=True):
        assert len(data) == len(songs.names())
        mean = np.mean([episode["f1"] for episode in data.episodes])
        assert f"{mean:.3f} |" in next(line for line in readme.splitlines() if f"`{name}`" in line)
        card = (FOLDER / name / "README.md").read_text("utf-8")
        assert "license: cc0-1.0" in card
        assert "public domain" in card


def test_what_a_learned_policy_plays_is_not_said_to_be_free(tmp_path):
    out = tmp_path / "learned.zarr"
    options = ["--player", "three-stage", "--seconds", "2", "--jobs", "1"]
    cli.main(["perform", "c-major-study", "-o", str(out), *options])
    assert "license: unknown" in (out / "README.md").read_text("utf-8")


def test_policies_can_learn_from_them():
    data = trajectory_dataset([FOLDER / name for name in NAMES])
    assert len(data.name) == 2 * len(songs.names())
    assert len(set(data.song_id.tolist())) == len(songs.names()), (
        "each song is one, with noise and without"
    )


@pytest.mark.parametrize(("name", "noise"), list(zip(NAMES, ("0", "0.2"), strict=True)))
def test_the_command_makes_them(name, noise, tmp_path):
    out = tmp_path / name
    options = ["--seconds", "inf", "--lead-in", "1", "--noise", noise, "--jobs", "1"]
    cli.main(["perform", "c-major-study", "-o", str(out), *options])
    made, there = TrajectoryData.open(out), TrajectoryData.open(FOLDER / name)
    digest = made.episodes[0]["source"]["digest"]
    number = [one["source"]["digest"] for one in there.episodes].index(digest)
    again, kept = (
        data.columns(at, ["joints", "goal"]) for data, at in ((made, 0), (there, number))
    )
    np.testing.assert_array_equal(again["goal"], kept["goal"])
    # Another kind of processor rounds otherwise, which contacts make more of as it goes on.
    np.testing.assert_allclose(again["joints"][:20], kept["joints"][:20], atol=1e-3)
    assert made.episodes[0]["f1"] == pytest.approx(there.episodes[number]["f1"], abs=0.03)

"""`pianomime report`: a saved performance makes the report that `pianomime play` made."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import made_up
from pianomime import Performance, register_player
from pianomime.cli import main
from pianomime.music import Score
from pianomime.plan import FingertipPlan
from pianomime.players import Player
from pianomime.track import Controller, ReplayTracker

FILES = {
    "performance.mid",
    "performance.npz",
    "performance.wav",
    "piano_roll.png",
    "piano_roll_dark.png",
    "report.html",
    "report.json",
}


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def performance() -> Performance:
    """Of a score that was mended while it was read."""
    score = replace(made_up.score(20, 3.0), remarks=("notes without an end: 2", "left out: 1"))
    return made_up.performance(score)


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_the_report_is_that_of_the_player(capsys: pytest.CaptureFixture[str]) -> None:
    main(["play", "ode-to-joy", "--effort", "0", "--seconds", "1", "-o", "played"])
    told = capsys.readouterr().out
    main(["report", "played/performance.npz", "-o", "shown"])
    assert capsys.readouterr().out == told.replace("played/", "shown/")
    assert {file.name for file in Path("shown").iterdir()} == FILES
    for name in FILES - {"performance.npz"}:  # A zip file holds the time at which it was made.
        assert Path("shown", name).read_bytes() == Path("played", name).read_bytes(), name


@pytest.mark.parametrize(
    ("name", "out"),
    [
        ("performance.npz", "."),
        ("songs/fur-elise-0123.npz", "songs/fur-elise-0123"),
        ("songs/...npz", "songs/untitled-*"),
    ],
)
def test_where_the_report_goes(name: str, out: str, performance: Performance) -> None:
    Path("songs").mkdir()
    performance.save(name)
    main(["report", name])
    (folder,) = Path().glob(out) if out != "." else [Path()]
    assert {file.name for file in folder.iterdir()} - {"songs"} == FILES
    row = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert row["remarks"] == list(performance.score.remarks)
    assert Performance.load(name).score.remarks == performance.score.remarks


def test_a_film_stays_with_its_performance(
    performance: Performance, capsys: pytest.CaptureFixture[str]
) -> None:
    def report(name: str) -> tuple[list[str], bool]:
        """What is said of the film, and whether the page shows it."""
        main(["report", name, "-o", "shown"])
        told = [line for line in capsys.readouterr().out.splitlines() if "performance.mp4" in line]
        page = Path("shown", "report.html").read_text(encoding="utf-8")
        return told, "data:video/mp4" in page

    performance.save("one.npz")
    made_up.performance(performance.score, mistakes=0.5).save("other.npz")
    assert report("one.npz") == ([], False)
    film = Path("shown", "performance.mp4")
    film.write_bytes(b"a film")
    told, shown = report("one.npz")
    assert "stays" in told[0]
    assert film.read_bytes() == b"a film"
    assert shown
    told, shown = report("other.npz")
    assert "removed" in told[0]
    assert not film.exists()
    assert not shown
    assert report("other.npz") == ([], False)


def test_what_is_no_performance_is_one_line(
    performance: Performance, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "none.npz" in fails(["report", "none.npz"], capsys)
    Path("text.npz").write_text("this is none")
    assert "not a performance" in fails(["report", "text.npz"], capsys)
    performance.save("my song.npz")
    Path("cut.npz").write_bytes(Path("my song.npz").read_bytes()[:-50])
    assert "damaged" in fails(["report", "cut.npz"], capsys)
    # It was played already: the command that helps can be copied.
    assert "`pianomime report 'my song.npz'`" in fails(["play", "my song.npz"], capsys)
    assert sorted(os.listdir()) == ["cut.npz", "my song.npz", "text.npz"]


class OfOneExcerpt(Player):
    """Like an expert, plays the one second that it knows; its hands rest."""

    name = "of one excerpt"
    excerpt = 0.5, 1.0

    def start(self, score: Score) -> Controller:
        assert score.frames() <= 21
        frames, nobody = score.frames(), np.full(len(score), -1, np.int8)
        plan = FingertipPlan(
            np.zeros((frames, 2, 6, 3)), np.full((frames, 2, 5), -1, np.int8), nobody, nobody
        )
        return ReplayTracker(np.zeros((frames, 46))).start(plan)


def test_a_player_of_one_excerpt_takes_what_it_was_trained_with(
    capsys: pytest.CaptureFixture[str],
) -> None:
    register_player("one-excerpt", lambda effort, seed: OfOneExcerpt())
    song = ["ode-to-joy", "--player", "one-excerpt"]
    trained = ["--start", "0.5", "--seconds", "1", "--effort", "0"]
    main(["play", *song, *trained, "-o", "played"])
    # It begins with the music; of half a second before it, the default, nothing is left.
    assert Performance.load("played/performance.npz").score.onset[0] == 0.0
    main(["evaluate", *song, "--seconds", "1", "-o", "evaluated"])
    for command in ("play", "evaluate"):
        told = fails([command, *song, "--seconds", "2", "-o", "other"], capsys)
        assert "seconds" in told
        assert "1" in told
    assert "--start" in fails(["play", *song, "--start", "1", "-o", "other"], capsys)
    assert "--effort" in fails(["play", *song, "--effort", "2", "-o", "other"], capsys)
    for command in ("play", "evaluate"):
        told = fails([command, *song, "--lead-in", "0.5", "-o", "other"], capsys)
        assert "lead-in 0.5: one-excerpt plays music of its own" in told
    main(["play", *song, "--lead-in", "0", "-o", "played"])
    assert sorted(os.listdir()) == ["evaluated", "played"]

"""Songs with odd names are played, reported, scored and stored like all others."""

from __future__ import annotations

import io
import json
import os
import re
import sys
import unicodedata
import warnings
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import made_up
from odd_names import ODD, make_songs
from pianomime.cli import main
from pianomime.commands.progress import bars
from pianomime.evaluation.evaluation import evaluate
from pianomime.file_names import file_name
from pianomime.music import Score
from pianomime.plan.demonstration import Demonstration
from pianomime.players.performance import Performance
from pianomime.report import FILES, write_diagnosis, write_report
from pianomime.shown import shown, title_of

TITLES = [os.fsdecode(name) for name in ODD]
BRIEF = ["--seconds", "0.5", "--effort", "0"]


@pytest.fixture(autouse=True)
def _workplace(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "songs").mkdir()


def acting(text: str) -> set[str]:
    """What a terminal would act on, but for ends of lines."""
    kept = "\n\u200c\u200d"
    return {letter for letter in text if unicodedata.category(letter) in ("Cc", "Cf", "Cs")} - {
        *kept
    }


def test_a_folder_of_odd_names_is_evaluated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Whatever is edited meanwhile: results are found by the names of songs.
    monkeypatch.setattr("pianomime.evaluation.evaluation.program_hash", lambda: "")
    songs = make_songs(tmp_path / "songs")
    broken = tmp_path / "songs" / os.fsdecode(b"\x1b[31mbroken\xff|.mid")
    broken.write_bytes(b"this is no music")
    lost = tmp_path / "songs" / "lost.mid"
    lost.symlink_to("nowhere")
    main(["evaluate", "songs", "-o", "out", "--jobs", "2", *BRIEF])

    said = capsys.readouterr()
    assert not acting(said.out + said.err)
    results = json.loads(Path("out", "results.json").read_text(encoding="utf-8"))
    rows = {row["song"]: row for row in results["songs"]}
    assert set(rows) == {title_of(song) for song in (*songs, broken, lost)}
    failed = {song for song, row in rows.items() if "error" in row}
    assert failed == {title_of(broken), title_of(lost)}
    assert "is not a MIDI file" in rows[title_of(broken)]["error"]
    table = Path("out", "results.md").read_text(encoding="utf-8")
    assert said.out.startswith(table)
    # Nothing in a name is a bar, a break or markup of the table.
    lines = table.partition("\n\n")[0].splitlines()
    assert len(lines) == 2 + len(rows) + 1
    assert {len(re.findall(r"(?<!\\)\|", line.replace("\\\\", ""))) for line in lines} == {11}
    assert any(line.startswith("| Song \\[piano\\] |") for line in lines)

    # One file for each song that was finished, which the next evaluation finds.
    assert len(list(Path("out", "songs").glob("*.json"))) == len(songs)
    played: list[int] = []
    again = evaluate(
        "songs",
        effort=0,
        seconds=0.5,
        out="out",
        progress=lambda phase, done, total, remark="": played.append(done),
    )
    assert again["songs"] == results["songs"]
    assert {path.name for path in tmp_path.iterdir()} == {"songs", "out"}


@pytest.mark.parametrize(
    "name", [b"..", b"caf\xe9", b"x" * 251, b"$\\frac$", b"Song [piano]", b"\x1b[31mred\n"]
)
def test_a_song_with_an_odd_name_is_played(
    name: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    song = Path("songs", os.fsdecode(name + b".mid"))
    try:
        song.write_bytes(made_up_midi(tmp_path))
    except OSError:
        pytest.skip("the file system does not allow this name")
    main(["play", str(song), *BRIEF])

    said = capsys.readouterr()
    assert not acting(said.out + said.err)
    assert Score.from_midi(song).title[:20] in said.out
    (out,) = Path("out").iterdir()
    assert out.name == file_name(song.stem)
    assert {"report.html", "report.json"} <= {file.name for file in out.iterdir()} <= set(FILES)
    assert {path.name for path in tmp_path.iterdir()} == {"songs", "out", "made-up.mid"}

    main(["diagnose", str(out / "performance.npz")])
    said = capsys.readouterr()
    assert not acting(said.out + said.err)
    assert Score.from_midi(song).title[:20] in said.out


def made_up_midi(folder: Path) -> bytes:
    """The bytes of a MIDI file."""
    path = folder / "made-up.mid"
    made_up.score(notes=6, seconds=1.0).to_midi(path)
    return path.read_bytes()


class _Shown(HTMLParser):
    """The text of the title and the headline of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self._within = ""
        self.text: dict[str, str] = {}
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._within = tag

    def handle_endtag(self, tag: str) -> None:
        self._within = ""

    def handle_data(self, data: str) -> None:
        self.text[self._within] = self.text.get(self._within, "") + data


@pytest.mark.parametrize("title", ["caf\udce9 <i>&amp; $\\frac$", "\x1b[31m\n月光 ${song} $song"])
def test_a_report_of_an_odd_title_says_it(title: str, tmp_path: Path) -> None:
    score = made_up.score(notes=6, seconds=1.0, title=title)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # Letters that the font lacks are no matter for a warning.
        row = write_report(
            made_up.performance(score), tmp_path, False, lambda *_, **__: None, lambda _: None
        )
    assert row["song"] == shown(title)
    page = _Shown((tmp_path / "report.html").read_text(encoding="utf-8")).text
    assert page["h1"] == shown(title)
    assert page["title"] == f"{shown(title)} - PianoMime"
    assert json.loads((tmp_path / "report.json").read_text(encoding="utf-8")) == row


def test_a_diagnosis_of_odd_titles_says_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = []
    performances = []
    for number, title in enumerate(TITLES):
        made = made_up.performance(made_up.score(notes=4, seconds=0.6, title=title, seed=number))
        paths.append(tmp_path / f"{number}.npz")
        made.save(paths[-1])
        performances.append(Performance.load(paths[-1]))
    write_diagnosis(performances, tmp_path)
    said = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    assert [song["song"] for song in said["songs"]] == [shown(title) for title in TITLES]
    main(["diagnose", *map(str, paths[:9]), "-o", "out"])
    shown_there = capsys.readouterr().out
    assert not acting(shown_there)
    assert "Song [piano]" in shown_there


@pytest.mark.parametrize("title", TITLES)
def test_files_hold_odd_titles(title: str, tmp_path: Path) -> None:
    score = made_up.score(notes=6, seconds=1.0, title=title)
    assert score.title == shown(title)
    score.to_midi(tmp_path / "a.mid")
    assert Score.from_midi(tmp_path / "a.mid").key.tolist() == score.key.tolist()
    made = made_up.performance(score)
    made.save(tmp_path / "a.npz")
    assert Performance.load(tmp_path / "a.npz").score.title == shown(title)
    shown_plan = Demonstration(score, made_up.plan(score), "source", np.full((3, 3), np.nan))
    shown_plan.save(tmp_path / "b.npz")
    assert Demonstration.load(tmp_path / "b.npz").score.title == shown(title)


@pytest.mark.parametrize(
    "arguments",
    [
        ["play", "no\x1b[31m\nsuch.mid"],
        ["play", "no\udcff.mid"],
        ["play", "twinkle-twinkle", "--player", "x\x1b[31m\udcff"],
        ["play", "twinkle-twinkle", "--effort", "\x1b[31m\udcff"],
        ["diagnose", "no\x1b[31m\udcff.npz"],
        ["no\x1b[31m\udcff"],
    ],
)
def test_an_error_is_one_line_of_letters(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert not acting(said)
    assert said.count("\n") == 1


def test_a_warning_is_one_line_of_letters(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from pianomime.commands.songs import Songs

    monkeypatch.setattr(Songs, "run", lambda self: warnings.warn("a\x1b[31m\nb", stacklevel=1))
    main(["songs"])
    assert capsys.readouterr().err == "pianomime: warning: a\\x1b[31m\\nb\n"


def test_a_terminal_that_lacks_a_letter_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stderr", io.TextIOWrapper(written, "ascii", write_through=True))
    with pytest.raises(SystemExit):
        main(["play", "月光.mid"])
    assert written.getvalue().startswith(b"pianomime: \\u6708\\u5149.mid: no such file")


def test_progress_shows_names_as_letters(capsys: pytest.CaptureFixture[str]) -> None:
    import time

    with bars(line_seconds=0.01) as progress:
        progress("[b]\x1b[31m\udcff", 1, 2, "\x9b1A")
        until = time.monotonic() + 10
        said = ""
        while not said and time.monotonic() < until:
            time.sleep(0.01)
            said = capsys.readouterr().err
    assert not acting(said)
    assert "[b]\\x1b[31m\\xff 1/2" in said

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import time
import wave
from pathlib import Path

import pytest

from one_line import fails
from pianomime import Performance, songs
from pianomime.cli import COMMANDS, main
from pianomime.errors import TrainingDiverged


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run in an empty folder; nothing but what a test asks for may be left there."""
    monkeypatch.chdir(tmp_path)


def test_help_is_there_and_cheap() -> None:
    heavy = (
        *("numpy", "mujoco", "warp", "mujoco_warp", "matplotlib", "torch", "rich"),
        "pianomime.players.player",
    )
    script = (
        "import sys, pianomime.cli as cli\n"
        "try: cli.main(['--help'])\n"
        "except SystemExit: pass\n"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    *text, loaded = done.stdout.splitlines()
    assert loaded == "[]"
    for command in COMMANDS:
        assert any(line.strip().startswith(command) for line in text)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_examples(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([command, "--help"])
    assert stopped.value.code == 0
    _, examples = capsys.readouterr().out.split("Examples:\n")
    assert f"\n  pianomime {command}" in "\n" + examples


def test_the_module_can_be_run() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "pianomime", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("pianomime 0.")


def test_bundled_songs_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    main(["songs"])
    assert capsys.readouterr().out.split() == list(songs.names())


def test_play_writes_the_whole_report(capsys: pytest.CaptureFixture[str]) -> None:
    main(["play", "ode-to-joy", "-o", "out", "--seconds", "2"])
    row = json.loads(Path("out/report.json").read_text(encoding="utf-8"))
    assert row["player"] == "zero-shot"
    assert 0 < row["f1"] <= 1
    # Half a second of silence, then two of music.
    assert row["song_seconds"] == pytest.approx(2.5, abs=0.1)
    assert Performance.load("out/performance.npz").score.onset[0] == 0.5
    with wave.open("out/performance.wav") as sound:
        assert sound.getnframes() / sound.getframerate() >= 1.5
    assert str(Path("out/report.html")) in capsys.readouterr().out
    assert os.listdir() == ["out"]


def test_play_goes_to_a_folder_named_after_the_song_by_default() -> None:
    Path("my song.MID").write_bytes(songs.path("beethoven-ode-to-joy").read_bytes())
    main(["play", "my song.MID", "--seconds", "1"])
    assert Path("out/my song/report.html").exists()


def test_what_cannot_be_played_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    whole = songs.path("beethoven-ode-to-joy").read_bytes()
    Path("empty.mid").write_bytes(b"")
    Path("text.mid").write_text("this is no music")
    # Within its header: what is cut further on is repaired.
    Path("cut.mid").write_bytes(whole[:10])
    Path("silent.mid").write_bytes(b"MThd\0\0\0\6\0\0\0\1\1\xe0" + b"MTrk\0\0\0\4\0\xff\x2f\0")
    Path("folder.mid").mkdir()
    for name in ("empty.mid", "text.mid", "cut.mid", "silent.mid", "folder.mid"):
        assert name in fails(["play", name], capsys)
    assert "ode-to-joy" in fails(["play", "nothing_of_the_kind"], capsys)
    assert sorted(os.listdir()) == ["cut.mid", "empty.mid", "folder.mid", "silent.mid", "text.mid"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--player", "liszt"], "zero-shot"),
        (["--seconds", "0"], "seconds must be more than 0"),
        (["--seconds", "-1"], "seconds must be more than 0"),
        (["--start", "-1"], "start must be 0 or more"),
        (["--start", "9999"], "nothing to play from 9999 s"),
        (["--lead-in", "-1"], "lead-in must be 0 to"),
        (["--lead-in", "nan"], "lead-in must be 0 to"),
        (["--lead-in", "inf"], "lead-in must be 0 to"),
        (["-o", "file"], "file: is a file"),
        (["-o", "file/below"], "file: is a file"),
        (["-o", "/proc/pianomime/out"], "/proc/pianomime/out: cannot be written"),
    ],
)
def test_options_that_make_no_sense_are_one_line(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("file").write_text("theirs")
    assert message in fails(["play", "ode-to-joy", *options], capsys)
    assert os.listdir() == ["file"]
    assert Path("file").read_text() == "theirs"


def test_evaluate_refuses_what_makes_no_sense(capsys: pytest.CaptureFixture[str]) -> None:
    Path("nothing").mkdir()
    Path("file").write_text("")
    assert "no MIDI files" in fails(["evaluate", "nothing"], capsys)
    assert "no songs" in fails(["evaluate"], capsys)
    assert "missing.mid" in fails(["evaluate", "missing.mid"], capsys)
    assert "zero-shot" in fails(["evaluate", "ode-to-joy", "--player", "liszt"], capsys)
    assert "jobs" in fails(["evaluate", "ode-to-joy", "--jobs", "0"], capsys)
    assert "is a file" in fails(["evaluate", "ode-to-joy", "-o", "file"], capsys)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["play"], "Missing from pianomime play: SONG"),
        (["play", "ode-to-joy", "--seconds", "x"], "--seconds: could not convert"),
        (["play", "ode-to-joy", "--secnds", "3"], "Unrecognized options: --secnds"),
        (["play", "ode-to-joy", "another"], "another"),
        (["play", "ode-to-joy", "--seconds"], "--seconds"),
        (["evaluate", "ode-to-joy", "--jobs", "1.5"], "--jobs"),
        (["songs", "all"], "all"),
    ],
)
@pytest.mark.parametrize("columns", ["40", "80", "200"])
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_wrong_usage_is_one_line_with_a_hint(
    arguments: list[str],
    message: str,
    columns: str,
    encoding: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", columns)
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(io.BytesIO(), encoding=encoding))
    line = fails(arguments, capsys)
    assert message in line
    assert line.endswith(f" (see pianomime {arguments[0]} --help)")
    assert line.isprintable()
    assert not set("│─╭╮╰╯") & set(line)
    assert "---" not in line
    assert "A MIDI file" not in line


def test_a_song_with_no_name_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert "name of a song is empty" in fails(["play", ""], capsys)
    assert "name of a song is empty" in fails(["evaluate", "ode-to-joy", " "], capsys)


@pytest.mark.skipif(os.name == "nt", reason="there are no such pipes on Windows")
@pytest.mark.parametrize("arguments", [["songs"], ["--help"], ["songs", "--help"]])
def test_nothing_is_said_where_nobody_reads_on(arguments: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, "-m", "pianomime", *arguments],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writer)
    assert done.returncode == 141
    assert done.stderr == ""


def test_work_that_failed_is_one_line_and_not_bad_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def diverges(_: object) -> None:
        raise TrainingDiverged("the loss is not a finite number at step 5")

    monkeypatch.setattr("pianomime.commands.songs.Songs.run", diverges)
    with pytest.raises(SystemExit) as stopped:
        main(["songs"])
    assert stopped.value.code == 1
    assert capsys.readouterr().err == "pianomime: the loss is not a finite number at step 5\n"


def test_an_unknown_command_is_refused_with_a_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert "play, report, evaluate" in fails(["juggle"], capsys)


@pytest.mark.skipif(os.name == "nt", reason="signals are another thing on Windows")
@pytest.mark.parametrize(
    ("command", "number"),
    [
        ("play", signal.SIGINT),
        ("play", signal.SIGTERM),
        ("evaluate", signal.SIGINT),
        ("evaluate", signal.SIGHUP),
    ],
)
def test_a_signal_stops_in_one_line_and_leaves_nothing_half_done(
    command: str, number: int, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-m", "pianomime", command, "ode-to-joy", "-o", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # What a shell starts in the background ignores Ctrl-C, and so would what that starts.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    began = time.monotonic()
    # Its hidden folder, or that of its songs, shows that it is at work.
    while not any(tmp_path.glob(".pianomime-*")) and not out.exists():
        assert process.poll() is None, process.stderr and process.stderr.read()
        assert time.monotonic() < began + 60
        time.sleep(0.02)
    process.send_signal(number)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 128 + number
    goes_on = "; the same command goes on where it was" if command == "evaluate" else ""
    assert errors.splitlines() == [f"pianomime: stopped{goes_on}"]
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []
    assert not any(tmp_path.glob(".pianomime-*"))

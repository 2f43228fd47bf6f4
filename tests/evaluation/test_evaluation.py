from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from full_disk import line_on_full_disk
from pianomime import Performance, evaluate, songs
from pianomime.cli import main
from pianomime.errors import InputError, WorkFailed
from pianomime.evaluation import evaluation
from pianomime.evaluation.song_worker import SONG_WORKER, song_request
from pianomime.evaluation.table import markdown
from pianomime.music import protocol_digest
from pianomime.music.protocol import CONSTANTS
from pianomime.policies.methods import WEIGHTS
from pianomime.songs.find import find_songs
from pianomime.workers import Worker


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Five songs that differ, and one file that is none."""
    folder = tmp_path / "songs"
    folder.mkdir()
    for name in songs.names()[:5]:
        (folder / f"{name}.mid").write_bytes(songs.path(name).read_bytes())
    (folder / "broken|one.mid").write_text("this is no music")
    return folder


def test_songs_are_scored_and_one_that_fails_is_a_row(folder: Path, tmp_path: Path) -> None:
    told: list[tuple[Any, ...]] = []
    out = tmp_path / "out"
    results = evaluate(
        [folder], seconds=1.0, jobs=2, out=out, progress=lambda *step: told.append(step)
    )

    assert results == json.loads((out / "results.json").read_text(encoding="utf-8"))
    asked = {"player", "effort", "seed", "world", "settings", "seconds", "lead_in"}
    assert set(results) == asked | {"songs", "mean", "measured", "causes"}
    assert (results["seconds"], results["lead_in"]) == (1.0, 0.0)
    rows = {row["song"]: row for row in results["songs"]}
    assert list(rows) == sorted(path.stem for path in folder.iterdir())
    broken = rows.pop("broken|one")
    assert set(broken) == {"song", "error"}
    assert len(rows) == 5
    mean = sum(row["f1"] for row in rows.values()) / 5
    assert results["mean"]["f1"] == pytest.approx(mean, abs=1e-6)
    assert {row["effort"] for row in rows.values()} == {results["effort"]}
    assert "effort" not in results["mean"]
    notes = [row["music"]["note_f1_50"] for row in rows.values()]
    assert results["mean"]["music"]["note_f1_50"] == pytest.approx(sum(notes) / 5, abs=1e-6)
    assert results["measured"]["f1"] == results["measured"]["music"]["note_f1_50"] == 5
    for name in ("restruck", "chord_spread_p90_ms", "pedal_lifts_kept"):
        known = [row["music"][name] for row in rows.values() if row["music"][name] is not None]
        assert results["measured"]["music"][name] == len(known)
    assert results["measured"]["body"]["hands_overlap"] == 5
    assert {row["protocol"] for row in rows.values()} == {protocol_digest()}
    assert [step[:3] for step in told] == [("songs", n, 6) for n in range(7)]
    assert told[-1][3] == f"mean F1 {mean:.3f}"

    for kind in ("missed", "wrong"):
        lost = sum(sum(row["causes"][kind].values()) for row in rows.values())
        wanted = sum(row["causes"]["wanted"] for row in rows.values())
        assert sum(results["causes"][kind].values()) == pytest.approx(lost / wanted, abs=1e-4)
    assert "causes" not in results["mean"]

    tables = (out / "results.md").read_text(encoding="utf-8").split("\n\n")
    *tables, causes = (text.splitlines() for text in tables)
    # By ear, with the one that failed; in frames; the hands.
    assert [len(table) for table in tables] == [2 + 6 + 1, 2 + 5 + 1, 2 + 5 + 1]
    assert len(causes) == 2 + sum(len(shares) for shares in results["causes"].values())
    # Every line has as many cells as the first, the bar in the broken one's name escaped.
    for table in tables:
        assert len({line.replace("\\|", "").count("|") for line in table}) == 1


def test_weights_that_cannot_be_read_are_told_once(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "fingers.onnx").write_bytes(b"no network")
    monkeypatch.setenv(WEIGHTS, str(tmp_path))
    with pytest.raises(InputError, match=r"damaged|onnxruntime"):
        evaluate([folder], "fingers", out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match="seed"):
        evaluate([folder], seed=-1)


def test_finished_songs_are_not_played_again(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    (folder / "broken|one.mid").unlink()
    first = evaluate(folder, seconds=1.0, jobs=2, out=out)
    assert all("f1" in row for row in first["songs"]), first["songs"]
    done = {file: file.stat().st_mtime_ns for file in (out / "songs").glob("*.json")}
    assert len(done) == 5

    assert evaluate(folder, seconds=1.0, out=out) == first
    assert {file: file.stat().st_mtime_ns for file in (out / "songs").glob("*.json")} == done

    # Another length, another player or another song under the same name is another result.
    one = folder / f"{songs.names()[0]}.mid"
    evaluate(one, seconds=1.5, jobs=1, out=out)
    evaluate(one, player="zero-shot-ik", seconds=1.0, jobs=1, out=out)
    one.write_bytes(songs.path(songs.names()[1]).read_bytes())
    evaluate(one, seconds=1.0, jobs=1, out=out)
    assert len(list((out / "songs").glob("*.json"))) == 5 + 3


def test_a_lead_in_is_another_result_and_no_part_of_the_seconds(tmp_path: Path) -> None:
    name = songs.names()[0]
    none = evaluate(name, "zero-shot-ik", seconds=1.0, jobs=1, out=tmp_path)
    half = evaluate(name, "zero-shot-ik", seconds=1.0, lead_in=0.5, jobs=1, out=tmp_path)
    assert (none["lead_in"], half["lead_in"]) == (0.0, 0.5)
    assert len(list(tmp_path.glob("songs/*.json"))) == 2
    (before,), (after,) = none["songs"], half["songs"]
    assert after["frames"] == before["frames"] + 10
    assert after["notes"] == before["notes"]
    scores = [
        Performance.load(tmp_path / row["performance"]).score.roll() for row in (before, after)
    ]
    np.testing.assert_array_equal(scores[1], np.pad(scores[0], ((10, 0), (0, 0))))
    # An int is the same time.
    for lead_in in (0, 0.5):
        evaluate(name, "zero-shot-ik", seconds=1.0, lead_in=lead_in, jobs=1, out=tmp_path)
    assert len(list(tmp_path.glob("songs/*.json"))) == 2
    for wrong in (-1.0, float("nan"), float("inf")):
        with pytest.raises(InputError, match="lead-in must be"):
            evaluate(name, lead_in=wrong, out=tmp_path)


@pytest.mark.parametrize(
    "damage", ["F1 edited", "F1 as text", "a list", "nested", "another's", "empty"]
)
def test_damaged_results_are_played_again_and_not_reported(tmp_path: Path, damage: str) -> None:
    name = songs.names()[0]
    out = tmp_path / "out"
    first = evaluate(name, "zero-shot-ik", seconds=1.0, jobs=1, out=out)
    (file,) = (out / "songs").glob("*.json")
    content = json.loads(file.read_text(encoding="utf-8"))
    changed = {
        "F1 edited": json.dumps({**content, "f1": 1.0}),
        "F1 as text": json.dumps({**content, "f1": "1.0"}),
        "a list": "[]",
        "nested": "[" * 100_000,
        "empty": "",
        "another's": "",
    }[damage]
    if damage == "another's":
        evaluate(name, "zero-shot-ik", seconds=1.5, jobs=1, out=tmp_path / "other")
        (other,) = (tmp_path / "other" / "songs").glob("*.json")
        changed = other.read_text(encoding="utf-8")
    file.write_text(changed, encoding="utf-8")
    with pytest.warns(UserWarning, match=r"damaged.* the song is played again"):
        again = evaluate(name, "zero-shot-ik", seconds=1.0, jobs=1, out=out)
    assert again["songs"][0]["f1"] == first["songs"][0]["f1"]
    assert json.loads(file.read_text(encoding="utf-8"))["f1"] == first["songs"][0]["f1"]


@pytest.mark.skipif(os.name == "nt", reason="there is no kill -9 on Windows")
def test_a_killed_run_goes_on_where_it_was(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["evaluate", str(folder), "-o", str(out), "--seconds", "1", "--jobs", "1"]
    process = subprocess.Popen([sys.executable, "-m", "pianomime", *arguments])
    began = time.monotonic()
    while len(list(out.glob("songs/*.json"))) < 2:
        assert process.poll() is None
        assert time.monotonic() < began + 60
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert not (out / "results.json").exists()
    done = {file: file.stat().st_mtime_ns for file in out.glob("songs/*.json")}
    assert 2 <= len(done) < 5
    for file in done:
        json.loads(file.read_text(encoding="utf-8"))

    results = evaluate(folder, seconds=1.0, jobs=2, out=out)
    assert sum("f1" in row for row in results["songs"]) == 5
    assert {file: file.stat().st_mtime_ns for file in done} == done


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such limits")
def test_a_full_disk_ends_the_run_in_one_line_and_it_goes_on_after(
    folder: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    one, two = (str(folder / f"{name}.mid") for name in songs.names()[:2])
    evaluate(one, "zero-shot-ik", seconds=1.0, jobs=1, out=out)
    done = {file: file.stat().st_mtime_ns for file in out.rglob("*.*")}
    options = ["-o", str(out), "--player", "zero-shot-ik", "--seconds", "1", "--jobs", "1"]
    line = line_on_full_disk(
        [sys.executable, "-m", "pianomime", "evaluate", one, two, *options], 5000
    )
    assert line.startswith(
        f"pianomime: {Path(two).name}: cannot be kept: File too large; all songs"
    )
    assert {file: file.stat().st_mtime_ns for file in out.rglob("*.*")} == done

    results = evaluate([one, two], "zero-shot-ik", seconds=1.0, jobs=1, out=out)
    assert ["f1" in row for row in results["songs"]] == [True, True]
    assert {file.stat().st_mtime_ns for file in out.glob("songs/*")} >= {
        time for file, time in done.items() if file.parent == out / "songs"
    }


def test_a_row_that_cannot_be_written_ends_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path) -> None:
        raise OSError(28, "No space left on device", str(path))

    monkeypatch.setattr(evaluation, "atomic", full)
    with pytest.raises(WorkFailed, match=r"json: cannot be kept: No space left on device; all"):
        evaluate(songs.names()[0], "zero-shot-ik", seconds=0.5, jobs=1, out=tmp_path)


def test_a_crash_costs_one_song(folder: Path) -> None:
    song = folder / f"{songs.names()[0]}.mid"
    setup = {"player": "zero-shot", "effort": 0, "seed": 0, "settings": {}}
    setup |= {"world": None, "seconds": 1.0, "lead_in": 0.0}
    with Worker(SONG_WORKER, setup) as worker:
        assert "f1" in worker.ask(song_request(song, None))
        os.kill(worker.pid, signal.SIGKILL)
        assert worker.ask(song_request(song, None)) == {"error": "its process died (exit code -9)"}
        assert "f1" in worker.ask(song_request(song, None))


@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError])
def test_no_process_outlives_a_run_that_stops(
    error: type[BaseException], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[subprocess.Popen[str]] = []
    start = Worker._start

    def note(worker: Worker) -> subprocess.Popen[str]:
        started.append(start(worker))
        return started[-1]

    def stop(phase: str, done: int, total: int, remark: str = "") -> None:
        if done:
            raise error

    monkeypatch.setattr(Worker, "_start", note)
    before = set(threading.enumerate())
    with pytest.raises(error):
        evaluate(folder, seconds=1.0, jobs=2, effort=0, progress=stop)
    for thread in set(threading.enumerate()) - before:
        thread.join(timeout=10)
    assert len(started) == 2
    assert all(process.poll() is not None for process in started)


def test_results_of_another_protocol_are_not_reused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = songs.names()[0]

    def finished() -> int:
        return len(list(tmp_path.glob("songs/*.json")))

    evaluate(name, "zero-shot-ik", seconds=0.5, jobs=1, out=tmp_path)
    assert finished() == 1
    changed = replace(CONSTANTS, match=0.2)
    monkeypatch.setattr("pianomime.music.protocol.CONSTANTS", changed)
    evaluate(name, "zero-shot-ik", seconds=0.5, jobs=1, out=tmp_path)
    assert finished() == 2


def test_a_worker_does_not_wait_for_what_only_reports_need() -> None:
    script = (
        "import sys, pianomime.evaluation.song_worker\n"
        "print([name for name in ('matplotlib', 'av', 'rich') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


def test_when_all_fail_there_is_no_mean(tmp_path: Path) -> None:
    (tmp_path / "broken.mid").write_text("this is no music")
    results = evaluate(tmp_path, jobs=1)
    assert results["mean"] == results["measured"] == {}
    assert results["causes"] == {"missed": {}, "wrong": {}}
    assert "failed" in markdown(results)
    assert list(tmp_path.iterdir()) == [tmp_path / "broken.mid"]


def test_the_command_fails_when_all_songs_do(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken, out = folder / "broken|one.mid", tmp_path / "out"
    options = ["-o", str(out), "--player", "zero-shot-ik", "--seconds", "0.5", "--jobs", "1"]
    with pytest.raises(SystemExit) as stopped:
        main(["evaluate", str(broken), *options])
    assert stopped.value.code == 1
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert line.startswith("pianomime: no song could be played: broken|one: ")
    assert f"saved: {out / 'results.json'}" in said.out
    assert "error" in json.loads((out / "results.json").read_text(encoding="utf-8"))["songs"][0]
    main(["evaluate", str(broken), songs.names()[0], *options])


def test_folders_are_searched_and_nothing_is_found_twice(folder: Path) -> None:
    deep = folder / "a" / "b"
    deep.mkdir(parents=True)
    (deep / "UPPER.MIDI").write_bytes(b"")
    (deep / "notes.txt").write_bytes(b"")
    found = find_songs([folder, deep / "UPPER.MIDI", "ode-to-joy"])
    assert len(found) == 6 + 1 + 1
    assert deep / "UPPER.MIDI" in found


def test_progress_is_told_before_any_process_works_and_has_no_mean_before_the_first_song(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "1.mid").write_text("this is no music")
    (tmp_path / "2.mid").write_bytes(songs.path(songs.names()[0]).read_bytes())
    told: list[tuple[Any, ...]] = []
    start = Worker._start

    def note(worker: Worker) -> subprocess.Popen[str]:
        assert told == [("songs", 0, 2, "")]
        return start(worker)

    monkeypatch.setattr(Worker, "_start", note)
    results = evaluate(
        tmp_path, seconds=1.0, jobs=1, effort=0, progress=lambda *step: told.append(step)
    )
    f1 = results["mean"]["f1"]
    remarks = ["", "", f"mean F1 {f1:.3f}"]
    assert told == [("songs", done, 2, remark) for done, remark in enumerate(remarks)]

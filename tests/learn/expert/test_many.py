"""Experts of many songs: rows whatever happens, and a Ray cluster that loses a node."""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from pianomime import staging
from pianomime.errors import InputError, WorkFailed
from pianomime.learn.expert import expert_worker, many
from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.expert.expert_run import ExpertRun
from pianomime.learn.expert.expert_worker import expert_request
from pianomime.learn.expert.many import experts_table, find_experts_songs, train_experts
from pianomime.learn.runs.config_json import to_json
from pianomime.plan.demonstration import Demonstration


@pytest.fixture
def songs(two_notes: Demonstration, tmp_path: Path) -> Path:
    """Three songs that can be played, and one file that cannot."""
    folder = tmp_path / "songs"
    (folder / "more").mkdir(parents=True)
    for name in ("a.npz", "b.npz", "more/a.npz"):
        two_notes.save(folder / name)
    (folder / "broken.mid").write_bytes(b"no music")
    return folder


def test_failed_songs_are_rows_and_finished_ones_are_kept(
    songs: Path, tmp_path: Path, small_search: ExpertConfig
) -> None:
    out = tmp_path / "out"
    reported: list[tuple[str, int, int, str]] = []

    def progress(phase: str, done: int, total: int, remark: str = "") -> None:
        reported.append((phase, done, total, remark))

    rows = train_experts(songs, out, small_search, jobs=2, progress=progress)
    assert [row["song"] for row in rows] == ["a", "b", "broken", "more-a"]
    assert [bool(row.get("error")) for row in rows] == [False, False, True, False]
    assert reported[0] == ("songs", 0, 4, "")
    mean = sum(row.get("f1", 0.0) for row in rows) / 3
    assert reported[-1] == ("songs", 4, 4, f"mean F1 {mean:.3f}")
    assert json.loads((out / "experts.json").read_text()) == rows
    assert (out / "experts.md").read_text() == experts_table(rows)
    assert "failed" in experts_table(rows)
    assert (out / "experts.png").read_bytes().startswith(b"\x89PNG")

    before = {path: path.stat().st_mtime_ns for path in out.glob("*/state.safetensors")}
    again = train_experts(songs, out, small_search, jobs=2)
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert [row.get("f1") for row in again] == [row.get("f1") for row in rows]


def test_runs_are_no_songs(songs: Path, small_search: ExpertConfig) -> None:
    """Runs keep their song, also those that were killed before they were runs."""
    names = list(find_experts_songs(songs))
    out = songs / "runs"
    first = [row["song"] for row in train_experts(songs, out, small_search, jobs=2)]
    assert first == names
    (out / "half").mkdir()
    (out / "half" / "demonstration.npz").write_bytes((songs / "a.npz").read_bytes())
    assert list(find_experts_songs(songs, out)) == names
    # Results of another call.
    (out / "half" / "demonstration.npz").unlink()
    assert list(find_experts_songs(songs, songs.parent)) == names
    with pytest.raises(InputError, match="name another folder"):
        train_experts(songs, songs, small_search)


def test_bad_input(tmp_path: Path, small_search: ExpertConfig) -> None:
    with pytest.raises(InputError, match="is not a folder"):
        train_experts(tmp_path / "none", tmp_path / "out", small_search)
    with pytest.raises(InputError, match="no demonstrations"):
        train_experts(tmp_path, tmp_path / "out", small_search)


def test_where_no_song_can_be_trained_results_stay(
    songs: Path, tmp_path: Path, small_search: ExpertConfig
) -> None:
    out = tmp_path / "out"
    with pytest.raises(InputError, match="seconds must be more than 0, not -1"):
        train_experts(songs, out, small_search, seconds=-1.0)
    assert not out.exists()
    train_experts(songs, out, small_search, jobs=2)
    before = {path: path.read_bytes() for path in out.glob("experts.*")}
    assert len(before) == 3
    other = dataclasses.replace(small_search, seed=1)
    with pytest.raises(WorkFailed, match=r"no expert was trained: a: .*other settings"):
        train_experts(songs, out, other, jobs=2)
    assert {path: path.read_bytes() for path in before} == before


def test_a_full_disk_ends_the_work(
    songs: Path, tmp_path: Path, small_search: ExpertConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def train(*_: Any, **__: Any) -> Any:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(expert_worker, "train_expert", train)
    row = expert_worker.train_one(
        expert_request(songs / "a.npz", tmp_path / "run", small_search, 0.0, 30.0)
    )
    assert row == {"unwritable": "No space left on device"}
    monkeypatch.setattr(many, "work", lambda *_, **__: (each for each in [("a", row)]))
    with pytest.raises(WorkFailed, match="a: cannot be kept: No space left on device"):
        train_experts(songs, tmp_path / "out", small_search)


def test_a_cluster_that_is_not_there(
    songs: Path, tmp_path: Path, small_search: ExpertConfig
) -> None:
    pytest.importorskip("ray", reason="the extra scale is not installed")
    with pytest.raises(InputError, match=r"no Ray cluster at '127\.0\.0\.1:1'"):
        train_experts(songs, tmp_path / "out", small_search, ray="127.0.0.1:1")


def test_a_cluster_that_loses_a_node_goes_on(
    songs: Path, tmp_path: Path, small_search: ExpertConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    ray = pytest.importorskip("ray", reason="the extra scale is not installed")
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
    long = dataclasses.replace(small_search, total_steps=4_000)
    out = tmp_path / "out"
    # The first node coordinates; all work is on two others.
    quick = {"health_check_timeout_ms": 1000, "health_check_period_ms": 500}
    head = {"num_cpus": 0, "_system_config": quick}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    try:
        nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
        cluster.wait_for_nodes()
        ray.init(address=cluster.address, log_to_driver=False)
        busy: list[list[str]] = []
        done = threading.Event()

        def lose_one() -> None:
            """Lose a node while it is in the middle of a song."""
            runs: list[str] = []
            while not any((out / run / "curve.json").exists() for run in runs):
                if done.wait(0.05):
                    return
                runs = _runs_being_trained(_raylet(nodes[0]), out)
            cluster.remove_node(nodes[0], allow_graceful=False)
            busy.append(runs)

        killer = threading.Thread(target=lose_one, daemon=True)
        killer.start()
        try:
            rows = train_experts(songs, out, long, ray="auto")
        finally:
            done.set()
        killer.join(60)
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert [len(runs) for runs in busy] == [1]
    assert [row["song"] for row in rows if "error" in row] == ["broken"]
    curves = [ExpertRun.load(out / row["song"]).curve() for row in rows if "error" not in row]
    assert all(curve[-1].steps >= long.total_steps for curve in curves)
    # The same song with the same seed: those that were interrupted have the same curve as the rest.
    assert curves[0] == curves[1] == curves[2]


def _raylet(node: Any) -> int:
    """Number of the process that all others of a node come from."""
    started: int = node.all_processes["raylet"][0].process.pid
    return started


def _runs_being_trained(raylet: int, out: Path) -> list[str]:
    """Runs whose lock a process of a node holds open: the one that trains in it."""
    runs = {staging._folder_name(run): run.name for run in out.iterdir()} if out.exists() else {}
    held = []
    for pid in _processes_below(raylet):
        with contextlib.suppress(OSError):  # It may end while it is looked at.
            links = [link.readlink() for link in Path("/proc", str(pid), "fd").iterdir()]
            held += [runs[link.parent.name] for link in links if link.parent.name in runs]
    return held


def _processes_below(parent: int) -> list[int]:
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = status.read_text().rpartition(")")[2].split()
            if int(fields[1]) == parent:
                child = int(status.parent.name)
                found += [child, *_processes_below(child)]
    return found


def test_a_kill_leaves_no_process(songs: Path, tmp_path: Path, small_search: ExpertConfig) -> None:
    endless = dataclasses.replace(small_search, total_steps=10_000_000)
    out = tmp_path / "out"
    (songs / "broken.mid").unlink()
    script = (
        "import json, sys\n"
        "from pathlib import Path\n"
        "from pianomime.learn.expert.config import ExpertConfig\n"
        "from pianomime.learn.expert.many import train_experts\n"
        "from pianomime.learn.runs.config_json import from_json\n"
        "config = from_json(ExpertConfig, json.loads(sys.argv[3]))\n"
        "train_experts(Path(sys.argv[1]), Path(sys.argv[2]), config, jobs=2)\n"
    )
    given = json.dumps(to_json(endless))
    asking = subprocess.Popen([sys.executable, "-c", script, str(songs), str(out), given])
    deadline = time.monotonic() + 60
    while len(list(out.glob("*/curve.json"))) < 2 and time.monotonic() < deadline:
        assert asking.poll() is None
        time.sleep(0.05)
    workers = _processes_below(asking.pid)
    assert len(workers) == 2
    asking.kill()
    asking.wait()
    deadline = time.monotonic() + 30
    while any(map(_works, workers)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(map(_works, workers))


def test_stopping_leaves_no_process(
    songs: Path, tmp_path: Path, small_search: ExpertConfig
) -> None:
    endless = dataclasses.replace(small_search, total_steps=10_000_000)

    def stop(phase: str, done: int, total: int, remark: str = "") -> None:
        if done:  # the broken one
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_experts(songs, tmp_path / "out", endless, jobs=4, progress=stop)
    assert not [pid for pid in _processes_below(os.getpid()) if _works(pid)]


def _works(pid: int) -> bool:
    """Whether a process of this module's pools is there."""
    try:
        return b"pianomime.workers" in Path("/proc", str(pid), "cmdline").read_bytes()
    except OSError:
        return False

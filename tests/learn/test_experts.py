"""Experts of many songs: rows whatever happens, and a Ray cluster that loses a node."""

from __future__ import annotations

import dataclasses
import json
import os
import threading
import time
from pathlib import Path

import pytest

from pianomime.errors import InputError
from pianomime.learn.config import ExpertConfig
from pianomime.learn.experts import experts_table, train_experts
from pianomime.learn.run_folder import RunFolder
from pianomime.video.demonstration import Demonstration


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
    told: list[tuple[int, int]] = []
    rows = train_experts(
        songs, out, small_search, jobs=2, progress=lambda done, total, _: told.append((done, total))
    )
    assert [row["song"] for row in rows] == ["a", "b", "broken", "more-a"]
    assert [bool(row.get("error")) for row in rows] == [False, False, True, False]
    assert told[0] == (0, 4)
    assert told[-1] == (4, 4)
    assert json.loads((out / "experts.json").read_text()) == rows
    assert (out / "experts.md").read_text() == experts_table(rows)
    assert "failed" in experts_table(rows)
    assert (out / "experts.png").read_bytes().startswith(b"\x89PNG")

    before = {path: path.stat().st_mtime_ns for path in out.glob("*/state.safetensors")}
    again = train_experts(songs, out, small_search, jobs=2)
    assert {path: path.stat().st_mtime_ns for path in before} == before
    assert [row.get("f1") for row in again] == [row.get("f1") for row in rows]


def test_bad_input(tmp_path: Path, small_search: ExpertConfig) -> None:
    with pytest.raises(InputError, match="is not a folder"):
        train_experts(tmp_path / "none", tmp_path / "out", small_search)
    with pytest.raises(InputError, match="no demonstrations"):
        train_experts(tmp_path, tmp_path / "out", small_search)


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
    long = dataclasses.replace(small_search, steps=4_000)
    out = tmp_path / "out"
    # The first node coordinates; all work is on two others.
    quick = {"health_check_timeout_ms": 1000, "health_check_period_ms": 500}
    head = {"num_cpus": 0, "_system_config": quick}
    cluster = Cluster(initialize_head=True, head_node_args=head)
    try:
        nodes = [cluster.add_node(num_cpus=1) for _ in range(2)]
        cluster.wait_for_nodes()
        ray.init(address=cluster.address, log_to_driver=False)
        lost: list[bool] = []

        def lose_one() -> None:
            while len(list(out.glob("*/curve.json"))) < 2:
                time.sleep(0.05)
            cluster.remove_node(nodes[0], allow_graceful=False)
            lost.append(True)

        killer = threading.Thread(target=lose_one)
        killer.start()
        rows = train_experts(songs, out, long, ray="auto")
        killer.join()
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert lost
    assert [row["song"] for row in rows if "error" in row] == ["broken"]
    curves = [RunFolder.load(out / row["song"]).curve() for row in rows if "error" not in row]
    assert all(curve[-1].steps >= long.steps for curve in curves)
    # The same song with the same seed: those that were interrupted have the same curve as the rest.
    assert curves[0] == curves[1] == curves[2]


def test_stopping_leaves_no_process(
    songs: Path, tmp_path: Path, small_search: ExpertConfig
) -> None:
    endless = dataclasses.replace(small_search, steps=10_000_000)

    def stop(done: int, total: int, f1: float) -> None:
        if done:  # the broken one
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_experts(songs, tmp_path / "out", endless, jobs=4, progress=stop)
    left = [
        pid
        for pid in filter(str.isdigit, os.listdir("/proc"))
        if str(tmp_path / "out").encode() in _command(pid)
    ]
    assert left == []


def _command(pid: str) -> bytes:
    try:
        return Path("/proc", pid, "cmdline").read_bytes()
    except OSError:
        return b""

"""Run folders: beginning, resuming after whatever happened, and what is refused."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pianomime.errors import InputError
from pianomime.learn.runs import run as run_module
from pianomime.learn.runs.run import RunFolder, is_run
from pianomime.learn.runs.safetensors_file import write_tensors

CONFIG = {"rate": 0.5, "net": {"width": 8, "heads": [1, 2]}, "trainer": {"steps": 3, "every": 5}}
ARRAYS = {"a": np.arange(6.0).reshape(2, 3), "b": np.array(7)}


def begin(path: Path, config: dict[str, Any] | None = None, **more: Any) -> RunFolder:
    with RunFolder.open(path, "network", config or CONFIG, **more) as run:
        return run


def test_what_is_kept_is_read_again(tmp_path: Path) -> None:
    with RunFolder.open(tmp_path / "a" / "run", "network", {**CONFIG, "pair": (1, 2)}) as run:
        assert run.state() is None
        assert not run.has_result
        run.checkpoint(ARRAYS, 4, {"curve": [1.5]})
        run.checkpoint(ARRAYS, 5, {"curve": [1.5, 2.5]})
        run.keep_result({"w": np.ones(3)}, {"f1": 0.5})
    assert is_run(run.path)
    assert run.tensorboard.parent == run.path
    read = RunFolder.load(run.path)
    assert (read.path, read.kind) == (run.path, "network")
    assert read.config == run.config == {**CONFIG, "pair": [1, 2]}
    state = read.state()
    assert state is not None
    assert (state.steps, state.metadata) == (5, {"curve": [1.5, 2.5]})
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(state.arrays[name], array)
    weights, measured = read.result()
    np.testing.assert_array_equal(weights["w"], np.ones(3))
    assert measured == {"f1": 0.5}


def test_the_same_config_resumes_and_another_is_refused_by_name(tmp_path: Path) -> None:
    begin(tmp_path / "run").checkpoint(ARRAYS, 4)
    state = begin(tmp_path / "run").state()
    assert state is not None
    assert state.steps == 4
    before = (tmp_path / "run" / "run.json").read_bytes()
    others: list[tuple[dict[str, Any], str]] = [
        ({**CONFIG, "rate": 0.25}, "rate: 0.5 there, 0.25 now"),
        ({**CONFIG, "net": {"width": 9, "heads": [1, 2]}}, r"net\.width: 8 there, 9 now"),
        ({**CONFIG, "more": 1}, "more: None there, 1 now"),
        ({"rate": 0.5}, "trainer: .* there, None now"),
    ]
    for other, message in others:
        with pytest.raises(InputError, match=message):
            begin(tmp_path / "run", other)
    with (
        pytest.raises(InputError, match=r"another kind of thing \(network, not expert\)"),
        RunFolder.open(tmp_path / "run", "expert", CONFIG),
    ):
        pass
    assert (tmp_path / "run" / "run.json").read_bytes() == before


def test_a_folder_in_which_nothing_was_trained_takes_other_settings(tmp_path: Path) -> None:
    begin(tmp_path / "run")
    begin(tmp_path / "run", {**CONFIG, "rate": 0.25}).checkpoint(ARRAYS, 1)
    with pytest.raises(InputError, match=r"rate: 0\.25 there, 0\.5 now"):
        begin(tmp_path / "run")


def test_settings_that_may_differ_are_those_of_the_last_call(tmp_path: Path) -> None:
    free = ("rate", "trainer.every", "no.such.setting")
    begin(tmp_path / "run").checkpoint(ARRAYS, 1)
    other = {**CONFIG, "rate": 9.0, "trainer": {"steps": 3, "every": 0}}
    begin(tmp_path / "run", other, may_differ=free)
    assert RunFolder.load(tmp_path / "run").config == other
    with pytest.raises(InputError, match=r"trainer\.steps: 3 there, 4 now"):
        begin(tmp_path / "run", {**other, "trainer": {"steps": 4}}, may_differ=free)
    with pytest.raises(InputError, match="rate"):
        begin(tmp_path / "run")


def test_a_folder_is_held_by_one_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_module, "_PATIENCE", 0.0)
    with RunFolder.open(tmp_path / "run", "network", CONFIG):
        with pytest.raises(InputError, match="another process"):
            begin(tmp_path / "run")
        # Reading is for everybody.
        assert RunFolder.load(tmp_path / "run").config == CONFIG
    begin(tmp_path / "run")


def test_what_a_kill_left_half_written_is_swept(tmp_path: Path) -> None:
    path = tmp_path / "run"
    ours = (".pianomime-0123456789abcdef", ".pianomime-ffffffffffffffff")
    for folder in (path, tmp_path / "resumed"):
        if folder != path:
            begin(folder)
        folder.mkdir(exist_ok=True)
        for name in ours:
            (folder / name / "out").mkdir(parents=True)
            (folder / name / "out" / "half").write_bytes(b"cut")
            (folder / name / "lock").touch()
        begin(folder)
        assert [name for name in os.listdir(folder) if name.startswith(".")] == []
    # What is not ours stays.
    (path / ".mine").mkdir()
    (path / ".run-a1b2c3").mkdir()
    begin(path)
    assert {".mine", ".run-a1b2c3"} <= {*os.listdir(path)}


def test_folders_that_hold_something_else_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="something else than a run"):
        begin(tmp_path)
    with pytest.raises(InputError, match="is a file"):
        begin(tmp_path / "notes.txt")
    assert os.listdir(tmp_path) == ["notes.txt"]
    assert not is_run(tmp_path)
    for path in (tmp_path, tmp_path / "none", tmp_path / "notes.txt"):
        with pytest.raises(InputError, match="not the folder of a run"):
            RunFolder.load(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", r"run\.json: damaged"),
        ("{", r"run\.json: damaged"),
        ("[]", r"run\.json: damaged"),
        ('{"kind": "network"}', r"run\.json: damaged"),
        ('{"run_version": 3}', r"run\.json: damaged"),
        ('{"run_version": 3, "kind": 3, "config": {}}', r"run\.json: damaged"),
        ('{"run_version": 1}', "a run of version 1; this program reads 3"),
    ],
)
def test_damaged_configs_are_one_line(tmp_path: Path, content: str, message: str) -> None:
    begin(tmp_path / "run")
    (tmp_path / "run" / "run.json").write_text(content)
    for read in (RunFolder.load, begin):
        with pytest.raises(InputError, match=message) as caught:
            read(tmp_path / "run")
        assert "\n" not in str(caught.value)


def test_damaged_checkpoints_and_results_are_one_line(tmp_path: Path) -> None:
    run = begin(tmp_path / "run")
    with pytest.raises(InputError, match="no result yet"):
        run.result()
    run.checkpoint(ARRAYS, 1)
    run.keep_result(ARRAYS, {})
    state, result = (run.path / f"{name}.safetensors" for name in ("state", "result"))
    for path, read in ((state, run.state), (result, run.result)):
        path.write_bytes(path.read_bytes()[:-9])
        with pytest.raises(InputError, match=f"{path.name}: damaged"):
            read()
    for metadata in ({}, {"steps": "many", "metadata": {}}, {"steps": 3}):
        write_tensors(state, ARRAYS, metadata)
        with pytest.raises(InputError, match="not the checkpoint of a run"):
            run.state()


def test_a_full_disk_leaves_what_was_there(
    tmp_path: Path, full_disk: Callable[[], AbstractContextManager[None]]
) -> None:
    run = begin(tmp_path / "run")
    run.checkpoint(ARRAYS, 1)
    run.keep_result(ARRAYS, {"f1": 0.5})
    files = sorted(os.listdir(run.path))
    with full_disk():
        run.checkpoint({"a": np.zeros(9)}, 2)
    with full_disk():
        run.keep_result({"a": np.zeros(9)}, {"f1": 0.6})
    state = run.state()
    assert state is not None
    assert state.steps == 1
    assert run.result()[1] == {"f1": 0.5}
    assert sorted(os.listdir(run.path)) == files


def test_a_kill_at_any_instant_leaves_a_whole_checkpoint(tmp_path: Path) -> None:
    script = (
        "import sys\n"
        "from pathlib import Path\n"
        "import numpy as np\n"
        "from pianomime.learn.runs.run import RunFolder\n"
        "with RunFolder.open(Path(sys.argv[1]), 'network', {'a': 1}) as run:\n"
        "    state = run.state()\n"
        "    step = 0 if state is None else state.steps\n"
        "    while True:\n"
        "        step += 1\n"
        "        run.checkpoint({'a': np.full(100_000, step)}, step)\n"
    )
    path, before = tmp_path / "run", 0
    for _ in range(3):
        process = subprocess.Popen([sys.executable, "-c", script, str(path)])
        deadline = time.monotonic() + 60
        while steps(path) <= before + 3:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.003)
        process.send_signal(signal.SIGKILL)
        process.wait()
        assert steps(path) > before
        before = steps(path)
    begin(path, {"a": 1})
    assert {"run.json", "state.safetensors"} == {*os.listdir(path)}
    assert json.loads((path / "run.json").read_text())["run_version"] == run_module.VERSION


def steps(path: Path) -> int:
    """Steps of the checkpoint, whose arrays must be those of that step; 0 if there is none."""
    if not is_run(path) or (state := RunFolder.load(path).state()) is None:
        return 0
    assert (state.arrays["a"] == state.steps).all()
    return state.steps

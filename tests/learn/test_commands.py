"""The command line of learning."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from pianomime.cli import COMMANDS, main
from pianomime.installation import install_command
from pianomime.learn.expert.expert_run import ExpertRun
from pianomime.learn.imitation.config import POLICIES
from pianomime.plan.demonstration import Demonstration

QUICK = ["--total-steps", "200", "--search.variations", "4", "--search.rounds", "1"]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, two_notes: Demonstration, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    two_notes.save("demo.npz")


def fails(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as stopped:
        main(arguments)
    assert stopped.value.code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def test_an_expert_is_trained_and_plays(capsys: pytest.CaptureFixture[str]) -> None:
    main(["train-expert", "demo.npz", "--preset", "best", "-o", "run", *QUICK])
    config = ExpertRun.load(Path("run")).config
    # What was asked for, and for the rest the preset.
    assert (config.method, config.env.base) == ("search", "dynamic")
    assert (config.total_steps, config.search.variations) == (200, 4)
    told = capsys.readouterr().out
    assert "pianomime play demo.npz --player run" in told
    main(["play", "demo.npz", "--player", "run", "-o", "report"])
    row = json.loads(Path("report/report.json").read_text())
    assert f"F1 {row['f1']:.3f}" in told
    assert row["player"] == "expert"
    Path("songs").mkdir()
    Path("demo.npz").rename("songs/demo.npz")
    main(["train-experts", "songs", "--preset=best", "-o", "all", "--jobs", "1", *QUICK])
    assert "| demo |" in capsys.readouterr().out
    main(["collect", "all", "-o", "experts.zarr"])
    assert "saved 1 episodes" in capsys.readouterr().out


def test_a_bundled_song_needs_no_demonstration() -> None:
    quick = [*QUICK, "--method", "search", "--seconds", "2"]
    main(["train-expert", "ode-to-joy", *quick])
    run = ExpertRun.load(Path("out/expert-ode-to-joy-paper"))
    assert run.demonstration.source == "zero-shot plan"
    main(["play", "ode-to-joy", "--player", str(run.path), "-o", "report"])


def test_what_cannot_be_done_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert "paper, best" in fails(["train-expert", "demo.npz", "--preset", "worst"], capsys)
    assert "total-steps" in fails(["train-expert", "demo.npz", "--total-steps", "0"], capsys)
    assert "no such file" in fails(["train-expert", "nothing.mid"], capsys)
    assert "does not exist; `pianomime" in fails(["train-expert", "nothing.npz"], capsys)
    assert "a second" in fails(["train-expert", "demo.npz", "--seconds", "0.2"], capsys)
    Path("other").mkdir()
    assert "neither the folder of a run" in fails(["play", "demo.npz", "--player", "other"], capsys)
    main(["train-expert", "demo.npz", "--method", "search", "-o", "run", *QUICK])
    capsys.readouterr()
    assert "--start 1: run plays the excerpt" in fails(
        ["play", "demo.npz", "--player", "run", "--start", "1"], capsys
    )
    assert "not the score" in fails(["play", "ode-to-joy", "--player", "run"], capsys)
    assert "no runs" in fails(["collect"], capsys)
    assert "no demonstrations" in fails(["train-experts", "other"], capsys)


def test_without_the_extra_it_says_what_to_install() -> None:
    script = (
        "import sys\n"
        "class Without:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name in ('gymnasium', 'torch', 'stable_baselines3', 'safetensors', 'zarr'):\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Without())\n"
        "from pianomime.cli import main\n"
        "main(sys.argv[1:])\n"
    )
    for arguments in (
        ["train-expert", "demo.npz"],
        ["collect", "run"],
        ["teach", "demo.npz"],
        ["train", "bc-mse", "--experts", "some.zarr"],
        ["train-stage", "fingering", "--experts", "some.zarr"],
        *([name, "songs"] for name in ("train-goal", "train-sac", "train-fingers")),
    ):
        done = subprocess.run(
            [sys.executable, "-c", script, *arguments], capture_output=True, text=True, check=False
        )
        assert done.returncode == 2
        assert install_command("train") in done.stderr
        assert len(done.stderr.splitlines()) == 1
    helped = subprocess.run(
        [sys.executable, "-c", script, "train-expert", "--help"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "Examples:" in helped.stdout


LEARNING = [
    name for name in COMMANDS if name.startswith(("train", "collect")) or name == "import-demos"
]


@pytest.mark.parametrize("command", LEARNING)
def test_help_tells_what_is_required(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main([command, "--help"])
    assert stopped.value.code == 0
    told = capsys.readouterr().out
    assert "Examples:" in told
    assert "(default: )" not in told
    assert "(required)" in told


def test_help_lists_the_policies(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["train", "--help"])
    about = capsys.readouterr().out.partition("Examples:")[0].replace(",", " ")
    assert set(POLICIES) <= set(about.split())


MISSING: list[tuple[list[str], str]] = [
    (["train", "high-diff"], "`pianomime collect-dagger` with --experts, or demonstrations"),
    (["train", "low-diff"], "`pianomime collect-dagger` with --experts"),
    (["train", "bc-mse", "--experts", "no.zarr"], "does not exist; `pianomime collect-dagger"),
    (["train", "bc-mse", "--experts", "file"], "`pianomime collect-dagger"),
    (["train", "high-diff", "--demonstrations", "no"], "does not exist; `pianomime import-d"),
    (["train", "high-diff", "--demonstrations", "empty"], "`pianomime import-demos`"),
    (["collect-dagger", "demo.npz", "--device", "cuda"], "the device cuda needs"),
    (["train-stage", "fingering", "--experts"], "no data sets are named; "),
    (["train", "high-diff-no-sdf", "--experts", "x", "--goal", "y"], "needs no goal encoder"),
    (["collect", "run", "--demonstrations", "x.npz"], "--demonstrations: runs hold theirs"),
    (["train-sac", "x", "--seed", "4294967296"], "seed must be 0 to 4294967295"),
    (["train", "high-bet", "--experts", "x", "--bet.bins", "100000"], "bet.bins must be 2 to 1024"),
    (["train", "high-diff", "--demonstrations", "file"], "`pianomime import-demos`"),
    (["train", "low-mse", "--demonstrations", "demo.npz"], "`pianomime collect-dagger`"),
    (
        ["train", "high-diff", "--demonstrations", "demo.npz"],
        "`pianomime train-goal MIDI_FOLDER -o out/generalist/goal`",
    ),
    (
        ["train", "high-bet", "--demonstrations", "demo.npz", "--goal", "empty"],
        "`pianomime train-goal MIDI_FOLDER -o empty`",
    ),
    (
        ["train", "high-diff-no-sdf", "--demonstrations", "demo.npz", "-o", "file"],
        "file: is a file",
    ),
    (["train-stage", "fingering", "--experts", "no.zarr"], "`pianomime perform MIDI_FOLDER -o"),
    (["train-stage", "hand-motion", "--experts", "file"], "file: not a data set"),
    (["train-goal"], "FOLDER is missing"),
    (["train-goal", "empty"], "no MIDI files"),
    (["train-goal", "nope"], "nope: no such folder, file or bundled song"),
    (["train-goal", "ode-to-joy"], "did you mean 'beethoven-ode-to-joy'?"),
    (["train-goal", "beethoven-ode-to-joy"], "2 songs at least"),
    (["train-goal", "c-major-study", "twinkle-twinkle", "-o", "file/goal"], "file: is a file"),
    (["train-fingers", "nope"], "nope: no such folder, file or bundled song"),
    (["train-fingers", "twinkle-twinkle"], "9 songs at least"),
    (["train-sac"], "FOLDER is missing"),
    (["train-sac", "nope"], "nope: no such folder, file or bundled song"),
    (["train-sac", "twinkle-twinkle", "-o", "file"], "file: is a file"),
    (["train-expert", "no.npz"], "does not exist; `pianomime import-demos`"),
    (["train-expert", "empty"], "`pianomime train-experts empty`"),
    (["train-expert", "ode-to-joy", "-o", "file"], "file: is a file"),
    (["train-experts", "no"], "`pianomime train-expert`"),
    (["train-experts", "empty", "--jobs", "0"], "jobs must be 1 or more"),
    (["collect"], "name run folders"),
    (["collect", "no"], "does not exist; `pianomime train-expert`"),
    (["collect", "empty"], "no run"),
    (["collect", "demo.npz"], "needs --demonstrations"),
    (["collect", "empty", "-o", "empty"], "something else than a data set"),
    (["collect-dagger", "no.npz"], "does not exist; `pianomime import-demos`"),
    (["collect-dagger", "demo.npz", "-o", "file"], "something else than a data set"),
    (["collect-dagger", "demo.npz", "--rollout-policy", "no.onnx"], "no.onnx: does not exist"),
    (["import-demos", "no"], "no: does not exist"),
    (["import-demos", "file", "-o", "file"], "file: is a file"),
]
"""Commands that lack something, and a part of what they say."""


def test_what_is_missing_is_told_in_one_line_before_anything_heavy_is_imported() -> None:
    Path("file").write_text("text")
    Path("empty").mkdir()
    script = (
        "import sys\n"
        "from pianomime.cli import main\n"
        "for line in sys.stdin:\n"
        "    try:\n"
        "        main(line.rstrip().split('|'))\n"
        "    except SystemExit as stopped:\n"
        "        print(f'{stopped.code}', file=sys.stderr)\n"
        "print(*(name for name in ('torch', 'stable_baselines3', 'ray') if name in sys.modules))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        input="".join("|".join(arguments) + "\n" for arguments, _ in MISSING),
        capture_output=True,
        text=True,
        check=True,
    )
    told = done.stderr.splitlines()
    assert len(told) == 2 * len(MISSING), done.stderr
    for (arguments, message), line, code in zip(MISSING, told[::2], told[1::2], strict=True):
        assert message in line, (arguments, line)
        assert code == "2", (arguments, line)
    assert done.stdout.strip() == ""
    assert {path.name for path in Path().iterdir()} == {"demo.npz", "file", "empty"}
    assert not any(Path("empty").iterdir())


def test_torch_is_imported_only_to_learn() -> None:
    script = (
        "import sys, pianomime.learn.expert.expert, pianomime.learn.envs.gym_env\n"
        "import pianomime.learn.expert.trajectory_search\n"
        "print([name for name in ('torch', 'stable_baselines3', 'zarr') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"

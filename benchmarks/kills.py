"""Whether commands can be killed at any moment: nothing lives on, nothing stays, nothing is lost.

Each long command is begun with small settings, and killed at a random moment: by SIGKILL, by
SIGTERM as `kill` sends it, or by SIGINT to its whole process group as Ctrl-C does. Then
- no process that it started is left after a moment,
- after SIGTERM and SIGINT no hidden file is left, it says in one line that it was stopped, and its
  exit code is 143 or 130,
- the same command, given again, comes to its end; no hidden file is left by then, and its output is
  that of a run that nobody disturbed, but for times.

    python benchmarks/kills.py                                # 100 kills
    python benchmarks/kills.py --count 5 --commands play evaluate --seed 3

Linux only: processes are found by a mark in their environment. What `retarget` needs is given by
`--film`; without, it is skipped.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import random
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import common
from pianomime.learn.runs.safetensors_file import read_tensors
from pianomime.seal import SEAL

MARK = "PIANOMIME_KILLED_RUN"
"""Name in the environment of every process of a run."""
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
TIMES = {"plan_seconds", "simulate_seconds", "realtime_factor", SEAL}
"""Names of what differs from run to run, in JSON and in .npz files: times, and digests of them."""
_TIMED_TEXT = re.compile(r"\d[\d.,]*\s?(x|s|ms)\b|(?<=per second of computing)\D*[\d.]+")
"""Times in pages and tables."""
_STOPPED = re.compile(r"(pianomime: .* (left|so far).*\n)*pianomime: stopped.*\n")
"""What a command says that is stopped, and how far it is every half minute before."""
_LOGS = "tensorboard"
"""A folder of logs, with times and numbers of processes in the names of its files."""

_PATIENCE = 30.0
"""[s] for a command to end after a signal."""
_MOMENT = 3.0
"""[s] after its end for the processes that it started."""

_FEW = 3
"""Differences that are told."""

_SAC = """
import sys
from pianomime.learn.sac import training
training._CHECKPOINT_STEPS = 128  # It writes a checkpoint every 50,000 steps.
from pianomime.cli import main
main(sys.argv[1:])
"""
_TRAINER = shlex.split(
    "--trainer.steps=300 --trainer.batch=32 --trainer.warmup=10 --trainer.checkpoint-seconds=0.2"
)
_DIFFUSION = shlex.split(
    "--diffusion.channels 8 16 --diffusion.encoder-channels 8 --diffusion.condition-layers 16 "
    "--diffusion.steps=10"
)
_BET = shlex.split("--bet.layers=1 --bet.heads=2 --bet.width=16 --bet.bins=4")
_MLP = shlex.split("--mlp.hidden 16")
_SEARCH = shlex.split("--search.variations=4 --search.rounds=1 --total-steps=2000")
_PPO = shlex.split(
    "--ppo.num-envs=4 --ppo.steps-per-update=128 --ppo.batch-size=64 --ppo.n-epochs=2 "
    "--ppo.hidden 32 16 --total-steps=1280"
)


@dataclass(frozen=True)
class Case:
    """A command as it is tried.

    Attributes:
        arguments: after `pianomime`; `{inputs}` stands for the folder of inputs, `out` for output.
        needs: names of what must be in the folder of inputs, see `Inputs`.
        script: Python that runs the command, in place of `-m pianomime`.
    """

    arguments: Sequence[str]
    needs: Sequence[str] = ()
    script: str = ""


def _train(policy: str, network: Sequence[str], *data: str) -> Case:
    return Case(
        ["train", policy, *data, "--goal", "{inputs}/goal", "-o", "out", *_TRAINER, *network],
        ["demos", "experts.zarr", "goal"],
    )


_SONGS = ["{inputs}/songs"]
_EXPERTS = ["--experts", "{inputs}/experts.zarr"]
CASES = {
    "play": Case(
        ["play", "{inputs}/songs/0.mid", "-o", "out", "--effort=0"],
        ["songs"],
    ),
    "evaluate": Case(
        ["evaluate", *_SONGS, "-o", "out", "--effort=0", "--jobs=2"],
        ["songs"],
    ),
    "diagnose": Case(["diagnose", "{inputs}/performance.npz", "-o", "out"], ["performance.npz"]),
    "import-demos": Case(
        ["import-demos", "{inputs}/published.npz", "-o", "out"], ["published.npz"]
    ),
    "retarget": Case(["retarget", "{inputs}/film.mp4", "-o", "out/demo.npz"], ["film.mp4"]),
    "collect": Case(["collect", "{inputs}/runs", "-o", "out/experts.zarr"], ["runs"]),
    "collect-dagger": Case(
        ["collect-dagger", "{inputs}/demos", "-o", "out/dagger.zarr", "--jobs=2"], ["demos"]
    ),
    "perform": Case(["perform", *_SONGS, "-o", "out/songs.zarr", "--jobs=2"], ["songs"]),
    "train-expert (PPO)": Case(
        ["train-expert", "{inputs}/demos/0.npz", "-o", "out", *_PPO], ["demos"]
    ),
    "train-expert (search)": Case(
        ["train-expert", "{inputs}/demos/0.npz", "--preset=best", "-o", "out", *_SEARCH], ["demos"]
    ),
    "train-experts": Case(
        ["train-experts", "{inputs}/few", "--preset=best", "-o", "out", "--jobs=2", *_SEARCH],
        ["few"],
    ),
    "train-goal": Case(["train-goal", *_SONGS, "-o", "out", *_TRAINER], ["songs"]),
    "train (high-diff)": _train("high-diff", _DIFFUSION, "--demonstrations", "{inputs}/demos"),
    "train (low-diff)": _train("low-diff", _DIFFUSION, *_EXPERTS),
    "train (low-bet)": _train("low-bet", _BET, *_EXPERTS),
    "train (bc-mse)": _train("bc-mse", _MLP, *_EXPERTS),
    "train-fingers": Case(
        [
            *("train-fingers", *_SONGS, "-o", "out", "--threads=1", "--total-steps=2400"),
            *("--num-envs=2", "--steps-per-update=80", "--batch-size=100", "--n-epochs=1"),
            *("--hidden", "8", "--seconds=2"),
        ],
        ["songs"],
    ),
    "train-sac": Case(
        [
            *("train-sac", *_SONGS, "-o", "out", "--threads=1", "--total-steps=800"),
            *("--num-envs=2", "--gradient-steps=1", "--batch-size=8", "--buffer-size=1000"),
            *("--hidden", "16", "--seconds=2"),
        ],
        ["songs"],
        _SAC,
    ),
}


class Inputs:
    """What commands read, made when it is first asked for.

    Args:
        folder: for the inputs; made if need be.
        film: a video for `retarget`, if there is one.
    """

    def __init__(self, folder: Path, film: Path | None = None) -> None:
        self.folder, self._film = folder, film
        folder.mkdir(exist_ok=True)

    def lack(self, needs: Sequence[str]) -> str:
        """Make what is needed; a reason why it cannot be made, or ""."""
        for name in needs:
            if (self.folder / name).exists():
                continue
            if name == "film.mp4":
                if self._film is None:
                    return "no video: --film names one"
                if importlib.util.find_spec("mediapipe") is None:
                    return "the extra `video` is not installed"
                shutil.copy(self._film, self.folder / name)
                continue
            make: dict[str, Callable[[], None]] = {
                "songs": self._songs,
                "demos": self._demos,
                "few": self._few,
                "performance.npz": self._performance,
                "published.npz": self._published,
                "runs": lambda: self._run(
                    "train-experts", "few", "runs", "--preset=best", *_SEARCH
                ),
                "experts.zarr": lambda: self._run("collect-dagger", "demos", "experts.zarr"),
                "goal": lambda: self._run("train-goal", "songs", "goal", *_TRAINER),
            }
            make[name]()
        return ""

    def _run(self, command: str, source: str, out: str, *more: str) -> None:
        self.lack([source])
        case = Case([command, "{inputs}/" + source, "-o", "{inputs}/" + out, *more])
        done = subprocess.run(
            _command(case, self.folder), env=_environment(), capture_output=True, check=False
        )
        if done.returncode:
            raise SystemExit(f"{command}: {done.stderr.decode()}")

    def _songs(self) -> None:
        (self.folder / "songs").mkdir()
        # So many, because some are kept for validation.
        for number in range(10):
            _score(number).to_midi(self.folder / "songs" / f"{number}.mid")

    def _demos(self, number: int = 8, folder: str = "demos") -> None:
        from pianomime.plan import ZeroShotPlanner
        from pianomime.plan.demonstration import Demonstration

        (self.folder / folder).mkdir()
        for song in range(number):
            score = _score(song)
            made = Demonstration(score, ZeroShotPlanner().plan(score), source="made up")
            replace(made, song_id=song).save(self.folder / folder / f"{song}.npz")

    def _few(self) -> None:
        self._demos(3, "few")

    def _performance(self) -> None:
        from pianomime import load_player

        load_player("zero-shot-20hz", 0).play(_score(0)).save(self.folder / "performance.npz")

    def _published(self) -> None:
        from pianomime.plan.demonstration import Demonstration

        self.lack(["demos"])
        clips = [Demonstration.load(file) for file in sorted((self.folder / "demos").iterdir())]
        np.savez(
            self.folder / "published.npz",
            length=np.array([len(clip.plan) for clip in clips]),
            fingertips=np.concatenate([clip.plan.fingertips for clip in clips]),
            goal_packed=np.concatenate([np.packbits(clip.score.roll(), axis=1) for clip in clips]),
        )


def _score(number: int) -> Any:
    from pianomime.music import Score

    return Score(
        key=np.array([30 + number, 50 - number]),
        onset=np.array([0.3, 0.8]),
        offset=np.array([0.7, 1.4]),
        velocity=np.array([80, 80]),
        pedal=np.array([[0.5, 1.0]]),
        title=f"two notes {number}",
    )


@dataclass
class Tally:
    """What became of the kills of one command.

    Attributes:
        seconds: of a run that nobody disturbed [s].
        kills: by name of the signal.
        slowest: longest time from a signal to the end of the command [s].
        failures: one line each.
        skipped: why none was tried.
    """

    seconds: float = 0.0
    kills: dict[str, int] = field(default_factory=lambda: {each.name: 0 for each in SIGNALS})
    slowest: float = 0.0
    failures: list[str] = field(default_factory=list)
    skipped: str = ""


class Trial:
    """Runs of one command, all in a folder of the same path.

    Args:
        case: the command.
        inputs: what it reads.
        folder: for its runs.
    """

    def __init__(self, case: Case, inputs: Path, folder: Path) -> None:
        self._case, self._inputs = case, inputs
        self._place, self._temporary, self._said = (folder / n for n in ("run", "tmp", "said"))
        self._fresh()
        began = time.monotonic()
        process = self._start()
        self._listening(process)
        listening = time.monotonic()
        if process.wait():
            raise SystemExit(f"{' '.join(self._case.arguments)}: {self._errors()}")
        self.seconds = time.monotonic() - began
        self._working = time.monotonic() - listening
        self._wanted = content(self._place)

    def kill(self, number: signal.Signals, moment: float) -> tuple[list[str], float] | None:
        """Kill a run, and give the command again.

        Args:
            number: the signal.
            moment: when, as a share of the time that it takes.

        Returns:
            What is wrong, and the time that it took to end [s]; None if it had ended before.
        """
        self._fresh()
        process = self._start()
        if number != signal.SIGKILL:  # Before, its end is that of any Python.
            self._listening(process)
        try:
            process.wait(moment * self._working)
        except subprocess.TimeoutExpired:
            pass
        else:
            return None
        sent = time.monotonic()
        if number == signal.SIGINT:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        wrong = []
        try:
            process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            wrong.append(f"had not ended after {_PATIENCE:.0f} s")
        took = time.monotonic() - sent
        # With all done, while the interpreter ends, signals do what they do to any process.
        leaving = number != signal.SIGKILL and process.returncode == -number
        if process.returncode == 0 or (leaving and content(self._place) == self._wanted):
            return None
        left = self._processes()
        deadline = time.monotonic() + _MOMENT
        while left and time.monotonic() < deadline:
            time.sleep(0.05)
            left = self._processes()
        for pid, name in left.items():
            os.kill(pid, signal.SIGKILL)
            wrong.append(f"left a process: {name}")
        if number != signal.SIGKILL:
            if process.returncode != 128 + number:
                wrong.append(f"ended with {process.returncode}")
            if not _STOPPED.fullmatch(self._errors()):
                wrong.append(f"said {self._errors()!r}")
            wrong += [f"left {name} at once" for name in self._hidden()]
        again = self._start()
        if again.wait():
            return [*wrong, f"again: ended with {again.returncode}: {self._errors()}"], took
        wrong += [f"left {name} after the second run" for name in self._hidden()]
        wrong += [f"again: {line}" for line in differences(self._wanted, content(self._place))]
        return wrong, took

    def _fresh(self) -> None:
        for folder in (self._place, self._temporary):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)

    def _start(self) -> subprocess.Popen[bytes]:
        # To a file: a pipe would not end while a process that was left behind holds it.
        with self._said.open("wb") as said:
            return subprocess.Popen(
                _command(self._case, self._inputs),
                cwd=self._place,
                env=_environment()
                | {
                    MARK: str(self._place),
                    "TMPDIR": str(self._temporary),
                    # A cache that torch keeps on purpose.
                    "TORCHINDUCTOR_CACHE_DIR": str(self._inputs / "torch"),
                },
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=said,
                start_new_session=True,
                # What was started in the background ignores Ctrl-C, and so would what that starts.
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            )

    def _errors(self) -> str:
        """What the last run has said on stderr."""
        return self._said.read_text()

    @staticmethod
    def _listening(process: subprocess.Popen[bytes]) -> None:
        """Wait until a process has taken charge of SIGTERM."""
        bit = 1 << (signal.SIGTERM - 1)
        while process.poll() is None:
            status = Path("/proc", str(process.pid), "status").read_text()
            caught = re.search(r"^SigCgt:\s*(\w+)$", status, re.MULTILINE)
            if caught and int(caught[1], 16) & bit:
                return
            time.sleep(0.005)

    def _processes(self) -> dict[int, str]:
        """Commands of the processes that bear our mark, by their numbers."""
        mark = f"{MARK}={self._place}".encode()
        found = {}
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                if mark in (folder / "environ").read_bytes().split(b"\0"):
                    line = (folder / "cmdline").read_bytes()
                    found[int(folder.name)] = line.replace(b"\0", b" ").decode(errors="replace")
            except OSError:  # It has ended, or is another user's.
                continue
        return found

    def _hidden(self) -> list[str]:
        """What should not be there: hidden files, and anything among the temporary files."""
        found = [path for path in self._place.rglob(".*") if _LOGS not in path.parts]
        found += self._temporary.iterdir()
        return [str(path.relative_to(self._place.parent)) for path in found]


def _command(case: Case, inputs: Path) -> list[str]:
    begin = ["-c", case.script] if case.script else ["-m", "pianomime"]
    given = [argument.replace("{inputs}", str(inputs)) for argument in case.arguments]
    return [sys.executable, *begin, *given]


def _environment() -> dict[str, str]:
    # Sums are the same only on the same number of threads.
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
    return {**os.environ, **threads, "PYTHONWARNINGS": "ignore"}


def content(folder: Path) -> dict[str, Any]:
    """What is in the files of a folder, but for times, by their names."""
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if _LOGS in path.parts or not path.is_file():
            continue
        if path.suffix == ".npz":
            with np.load(path) as file:
                for array in sorted(set(file.files) - TIMES):
                    value = file[array]
                    found[f"{name}: {array}"] = value.dtype.str, value.shape, value.tobytes()
        elif path.suffix == ".safetensors":
            # Its library writes the metadata in another order each time.
            arrays, metadata = read_tensors(path)
            found[f"{name}: metadata"] = _without_times(metadata)
            for array, value in arrays.items():
                found[f"{name}: {array}"] = value.dtype.str, value.shape, value.tobytes()
        elif path.suffix == ".json":
            found[name] = _without_times(json.loads(path.read_text()))
        elif path.suffix in (".html", ".md"):
            found[name] = _TIMED_TEXT.sub("TIME", path.read_text())
        else:
            found[name] = path.read_bytes()
    return found


def _without_times(value: Any) -> Any:
    if isinstance(value, list):
        return [_without_times(each) for each in value]
    if isinstance(value, dict):
        # A row of experts.json has the time that it took under a name that settings have too.
        times = TIMES | ({"seconds"} if "steps" in value and "f1" in value else set())
        return {name: _without_times(each) for name, each in value.items() if name not in times}
    return value


def differences(wanted: dict[str, Any], found: dict[str, Any]) -> list[str]:
    """What differs between two outputs, in a line each; of many, the first few."""
    lines = [f"{name} is missing" for name in wanted.keys() - found.keys()]
    lines += [f"{name} should not be there" for name in found.keys() - wanted.keys()]
    both = wanted.keys() & found.keys()
    lines += [f"{name} is another" for name in both if wanted[name] != found[name]]
    few = sorted(lines)[:_FEW]
    return few if len(few) == len(lines) else [*few, f"and {len(lines) - _FEW} more"]


def tried(
    names: Sequence[str], count: int, seed: int, folder: Path, film: Path | None
) -> dict[str, Tally]:
    """Kill commands so often in all, taking turns.

    Args:
        names: of the commands in `CASES`.
        count: of kills.
        seed: of signals and moments.
        folder: where to work.
        film: for `retarget`.
    """
    draw = random.Random(seed)
    inputs = Inputs(folder / "inputs", film)
    tallies = {name: Tally(skipped=inputs.lack(CASES[name].needs)) for name in names}
    trials = {}
    for index, name in enumerate(names):
        if not tallies[name].skipped:
            trials[name] = Trial(CASES[name], inputs.folder, folder / str(index))
            tallies[name].seconds = trials[name].seconds
            print(f"{name}: {trials[name].seconds:.1f} s undisturbed", flush=True)
    done = 0
    while done < count and trials:
        for name, trial in trials.items():
            number, moment = SIGNALS[done % len(SIGNALS)], draw.random()
            while (result := trial.kill(number, moment)) is None:
                moment *= 0.8  # It is faster than the undisturbed run was.
            wrong, took = result
            tally = tallies[name]
            tally.kills[number.name] += 1
            tally.slowest = max(tally.slowest, took)
            line = f"{name}, {number.name} after {moment:.1%}"
            tally.failures += [f"{line}: {', '.join(wrong)}"] if wrong else []
            done += 1
            print(
                f"{done}/{count} {line}: {', '.join(wrong) or 'right'} ({took:.1f} s)", flush=True
            )
            if done == count:
                break
    return tallies


def main(arguments: Sequence[str] | None = None) -> int:
    """Kill commands, print a table, and give an exit code: 1 if anything was wrong."""
    parser = common.parser("kills", __doc__)
    parser.add_argument("--count", type=int, default=100, help="kills in all (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of signals and moments (%(default)s)")
    parser.add_argument("--commands", nargs="+", default=list(CASES), choices=list(CASES))
    parser.add_argument("--film", type=Path, help="a video for `retarget`")
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    given = parser.parse_args(arguments)
    facts = common.machine()
    with tempfile.TemporaryDirectory(prefix="kills-") as folder:
        tallies = tried(given.commands, given.count, given.seed, Path(folder), given.film)
    print()
    common.table(
        ["command", "seconds", *(each.name for each in SIGNALS), "failed", "slowest end [s]"],
        [
            [name, round(t.seconds, 1), *t.kills.values(), len(t.failures), round(t.slowest, 2)]
            for name, t in tallies.items()
            if not t.skipped
        ],
    )
    failures = [line for tally in tallies.values() for line in tally.failures]
    kills = sum(sum(tally.kills.values()) for tally in tallies.values())
    print(f"\n{kills - len(failures)} of {kills} kills left nothing and lost nothing")
    for name, tally in tallies.items():
        if tally.skipped:
            print(f"skipped: {name}: {tally.skipped}")
    for line in failures:
        print(f"failed: {line}")
    results = {name: vars(tally) for name, tally in tallies.items()}
    common.report(given.output, facts, {"kills": results})
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

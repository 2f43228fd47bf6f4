"""Memory and CPU time of a long piece, from MIDI to report and diagnosis, by phase.

The piece is made of the bundled songs, one after the other, until it is as long as asked; or of the
MIDI files that are named. It is played and reported on in a process of its own, as
`pianomime play` does it, while this one reads the memory of that process and of those that it
starts, a hundred times a second. Only what is measured is printed; nothing is checked.

    python benchmarks/long_piece.py --minutes 60
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import common
from pianomime import songs
from pianomime.music import Score
from pianomime.songs.find import find_songs

_PLAY = "--play"
_REST = 0.5
"""[s] Silence between two songs."""
_INTERVAL = 0.01
"""[s] Between two readings of the memory."""


class Phase(NamedTuple):
    """What one phase of the work took."""

    name: str
    peak_mib: float
    wall_seconds: float
    cpu_seconds: float


def piece(paths: list[Path], seconds: float) -> Score:
    """The songs one after the other, again and again, cut to a length [s]."""
    parts: list[tuple[Score, float]] = []
    end = 0.0
    read = [Score.from_midi(path).trim_silence() for path in paths]
    while end < seconds:
        song = read[len(parts) % len(read)]
        parts.append((song, end))
        end += song.duration + _REST
    return Score(
        key=np.concatenate([song.key for song, _ in parts]),
        onset=np.concatenate([song.onset + at for song, at in parts]),
        offset=np.concatenate([song.offset + at for song, at in parts]),
        velocity=np.concatenate([song.velocity for song, _ in parts]),
        pedal=np.concatenate([song.pedal + at for song, at in parts]),
        title="A long piece",
    ).clip(0.0, seconds)


def play(midi: Path, folder: Path, effort: int, video: bool) -> None:
    """Play, report and diagnose, and print a line of JSON when a phase begins."""
    started: list[str] = []

    def progress(phase: str, done: int, total: int, remark: str = "") -> None:
        if phase not in started[-1:]:
            started.append(phase)
            print(json.dumps({"phase": phase, "cpu": time.process_time()}), flush=True)

    progress("imports", 0, 0)
    from pianomime.music import excerpt
    from pianomime.players import load_player
    from pianomime.players.performance import Performance
    from pianomime.report import write_diagnosis, write_report

    progress("reading", 0, 0)
    score = excerpt(Score.from_midi(midi), 0.0, float("inf"))
    player = load_player("zero-shot-20hz", effort)
    row = write_report(player.play(score, progress), folder, video, progress, print_error)
    progress("diagnosis", 0, 0)
    write_diagnosis([Performance.load(folder / "performance.npz")], folder)
    progress("end", 0, 0)
    print(json.dumps({"row": row}), flush=True)


def print_error(line: str) -> None:
    """Print what could not be made."""
    print(line, file=sys.stderr)


def measure(midi: Path, folder: Path, effort: int, video: bool) -> dict[str, Any]:
    """Play in a process of its own, and watch its memory."""
    process = subprocess.Popen(
        [
            *(sys.executable, __file__, _PLAY, str(midi), str(folder), "--effort", str(effort)),
            *(["--video"] if video else []),
        ],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    begun: list[tuple[str, float, float]] = []
    peaks: dict[int, float] = {}
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(_INTERVAL):
            here = len(begun) - 1
            peaks[here] = max(peaks.get(here, 0.0), _resident_mib(process.pid))

    watcher = threading.Thread(target=watch)
    watcher.start()
    row: dict[str, Any] = {}
    for line in process.stdout:
        told = json.loads(line)
        row = told.get("row", row)
        if "phase" in told:
            begun.append((told["phase"], time.perf_counter(), told["cpu"]))
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    ended.set()
    watcher.join()
    if process.returncode:
        raise SystemExit(process.returncode)
    phases = [
        Phase(name, peaks.get(index, 0.0), then - at, cpu_then - cpu)
        for index, ((name, at, cpu), (_, then, cpu_then)) in enumerate(pairwise(begun))
    ]
    return {
        "phases": [phase._asdict() for phase in phases],
        "peak_mib": usage.ru_maxrss / 1024,  # of the process alone; Linux counts KiB
        "peak_with_children_mib": max(peaks.values()),
        "cpu_seconds": usage.ru_utime + usage.ru_stime,
        "f1": row["f1"],
        "files_mib": {file.name: file.stat().st_size / 2**20 for file in sorted(folder.iterdir())},
    }


def _resident_mib(pid: int) -> float:
    """Resident memory of a process and of all that it has started [MiB]; 0 where it has ended."""
    total, waiting = 0.0, [pid]
    while waiting:
        one = waiting.pop()
        try:
            pages = int(Path(f"/proc/{one}/statm").read_text("ascii").split()[1])
            children = Path(f"/proc/{one}/task/{one}/children").read_text("ascii").split()
        except (OSError, IndexError):
            continue
        total += pages * os.sysconf("SC_PAGE_SIZE") / 2**20
        waiting += [int(child) for child in children]
    return total


def main() -> None:
    """Make the piece, play it, and print the numbers."""
    options = common.parser("long_piece", __doc__)
    options.add_argument("songs", nargs="*", help="MIDI files, folders or bundled songs (all)")
    options.add_argument("--minutes", type=float, default=60.0, help="of music (%(default)s)")
    options.add_argument("--effort", type=int, default=0, help="0 to 3 (%(default)s)")
    options.add_argument("--video", action="store_true", help="render the film, too")
    options.add_argument("--keep", type=Path, help="existing folder for the report")
    options.add_argument(_PLAY, nargs=2, type=Path, help="used by this command itself")
    arguments = options.parse_args()
    if arguments.play:
        midi, out = arguments.play
        play(midi, out, arguments.effort, arguments.video)
        return
    facts = common.machine()
    common.show_machine(facts)
    with tempfile.TemporaryDirectory() as folder:
        midi, out = Path(folder, "piece.mid"), arguments.keep or Path(folder, "out")
        out.mkdir(exist_ok=True)
        score = piece(find_songs(arguments.songs or songs.names()), arguments.minutes * 60)
        score.to_midi(midi)
        made = measure(midi, out, arguments.effort, arguments.video)
    common.table(
        ("phase", "peak [MiB]", "wall [s]", "CPU [s]"),
        [
            (phase["name"], phase["peak_mib"], phase["wall_seconds"], phase["cpu_seconds"])
            for phase in made["phases"]
        ],
    )
    print()
    for name, size in made["files_mib"].items():
        print(f"{name}: {size:.1f} MiB")
    print(
        f"\n{arguments.minutes:g} minutes, {len(score)} notes, effort {arguments.effort}: "
        f"peak {made['peak_mib']:.0f} MiB "
        f"({made['peak_with_children_mib']:.0f} with its children), "
        f"{made['cpu_seconds']:.0f} s of CPU, F1 {made['f1']:.3f}"
    )
    settings = {name: getattr(arguments, name) for name in ("minutes", "effort", "video")}
    common.report(arguments.output, facts, {**settings, "notes": len(score), **made})


if __name__ == "__main__":
    main()

"""Time and memory of `pianomime play`, without the video, on a number of cores.

Every song is played by the command in a new process. Peak memory and whole time are those of that
process, with imports, sound and report; the times of planning and simulating are from its report.
The real-time factor is song / (planning + simulating).
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import common
from pianomime import songs
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.players.registry import EFFORT
from pianomime.songs.find import find_songs


def play(song: Path, seconds: float, player: str, effort: int, cores: list[int]) -> dict[str, Any]:
    """The measurements of one song, or its error."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "out")
        start = time.perf_counter()
        process = subprocess.Popen(
            [
                *(sys.executable, "-m", "pianomime", "play", str(song), "-o", str(out)),
                *("--lead-in", "0", "--seconds", str(seconds)),
                *("--player", player, "--effort", str(effort)),
            ],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: os.sched_setaffinity(0, cores),
        )
        assert process.stderr is not None
        error = process.stderr.read()
        # Unlike getrusage(RUSAGE_CHILDREN), this is the one process and not the largest so far.
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        took = time.perf_counter() - start
        if process.returncode:
            return {"song": song.stem, "error": error.strip().splitlines()[-1]}
        row = json.loads((out / "report.json").read_text("utf-8"))
    wanted = ("song", "song_seconds", "f1", "plan_seconds", "simulate_seconds", "realtime_factor")
    return {
        **{name: row[name] for name in wanted},
        "whole_seconds": took,
        "peak_mib": usage.ru_maxrss / 1024,  # Linux counts KiB
    }


def main() -> None:
    options = common.parser("speed_play", __doc__)
    options.add_argument(
        "songs", nargs="*", help="bundled songs, MIDI files or folders (all bundled songs)"
    )
    options.add_argument(
        "--seconds", type=float, default=EXCERPT_SECONDS, help="of each song (%(default)s)"
    )
    options.add_argument("--player", default="zero-shot", help="who plays (%(default)s)")
    options.add_argument("--rounds", type=int, default=1)
    options.add_argument("--effort", type=int, default=EFFORT, help="0 to 3 (%(default)s)")
    options.add_argument("--cores", type=int, default=1, help="to play on (%(default)s)")
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    if not 1 <= arguments.cores <= len(common.cores()):
        options.error(f"--cores must be 1 to {len(common.cores())}")
    cores = common.cores()[-arguments.cores :]
    files = find_songs(arguments.songs or songs.names())
    rows = []
    for file in files:
        runs = [
            play(file, arguments.seconds, arguments.player, arguments.effort, cores)
            for _ in range(arguments.rounds)
        ]
        failed = [run for run in runs if "error" in run]
        rows.append(failed[0] if failed else _median(runs))
        print(".", end="", flush=True)
    print("\n")
    played = [row for row in rows if "error" not in row]
    names = [name for name in played[0] if name != "song"] if played else []
    lines = [(row["song"], *(row[name] for name in names)) for row in played]
    if played:
        lines.append(("median", *(statistics.median(row[n] for row in played) for n in names)))
        lines.append(("lowest", *(min(row[name] for row in played) for name in names)))
        lines.append(("highest", *(max(row[name] for row in played) for name in names)))
    common.table(("song", *names), lines)
    for row in rows:
        if "error" in row:
            print(f"{row['song']}: {row['error']}")
    settings = {name: getattr(arguments, name) for name in ("seconds", "player", "effort", "cores")}
    common.report(arguments.output, facts, {**settings, "songs": rows})


def _median(runs: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        name: value if name == "song" else statistics.median(run[name] for run in runs)
        for name, value in runs[0].items()
    }


if __name__ == "__main__":
    main()

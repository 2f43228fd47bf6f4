"""Hours of playing that `pianomime perform` makes in an hour, with one process and with one a core.

The songs are those of the reference data (`pop/train`), played by the default player at effort 0.
The time is that of the whole command, with imports and the writing of the data set. The ratio is
that of many processes to one: as many as there are processes if songs did not slow each other down.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import common
from pianomime.keyboard import EXCERPT_SECONDS, FRAME_RATE
from pianomime.learn.data.trajectories import TrajectoryData
from pianomime.songs.find import find_songs

HOUR = 3600
SONGS = 24
"""Songs that are played if not told otherwise: a minute or two of work for one process."""


def made(songs: list[Path], seconds: float, jobs: int) -> dict[str, Any]:
    """What one run of the command gave."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "songs.zarr")
        began = time.perf_counter()
        subprocess.run(
            [
                *(sys.executable, "-m", "pianomime", "perform", *map(str, songs), "-o", str(out)),
                *("--seconds", str(seconds), "--jobs", str(jobs)),
            ],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        took = time.perf_counter() - began
        data = TrajectoryData.open(out)
        size = sum(file.stat().st_size for file in out.rglob("*") if file.is_file())
    played = int(data.ends[-1]) / FRAME_RATE
    return {
        "jobs": jobs,
        "songs": len(data),
        "played_hours": played / HOUR,
        "f1": sum(row["f1"] for row in data.episodes) / len(data),
        "seconds": took,
        "hours_an_hour": played / took,
        "megabytes_an_hour": size / 1e6 / (played / HOUR),
    }


def main() -> None:
    """Measure, print and write."""
    options = common.parser("factory", __doc__)
    options.add_argument("--songs", type=int, default=SONGS, help="how many (%(default)s)")
    options.add_argument(
        "--seconds", type=float, default=EXCERPT_SECONDS, help="of each [s] (%(default)s)"
    )
    given = options.parse_args()
    songs = find_songs([common.shared() / "data" / "pop" / "train"])[: given.songs]
    facts, rows = common.machine(), []
    print("| processes | songs | h played | s | h of playing an hour | MB an hour | F1 |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for jobs in sorted({1, len(common.cores())}):
        row = made(songs, given.seconds, jobs)
        rows.append(row)
        print(
            f"| {jobs} | {row['songs']} | {row['played_hours']:.3f} | {row['seconds']:.1f} "
            f"| {row['hours_an_hour']:.1f} | {row['megabytes_an_hour']:.0f} | {row['f1']:.3f} |"
        )
    ratio = rows[-1]["hours_an_hour"] / rows[0]["hours_an_hour"]
    print(f"\nratio of {rows[-1]['jobs']} processes to one: {ratio:.2f}")
    common.report(given.output, facts, {"runs": rows, "ratio": ratio})


if __name__ == "__main__":
    main()

"""How well notes are played now, for tests that notice when they are played worse.

Made anew by `python benchmarks/digest.py --write`, or without the other tables by
`python benchmarks/stored_notes.py`. Each song is played many times by the player of notes, with
plans that differ in the last bits; the mean and the worst of each measure are stored.
"""

from __future__ import annotations

import json
import os
import warnings
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from common import ROOT, cores, parser
from disturbed import disturbed
from pianomime import Score, excerpt, songs
from pianomime.files import atomic
from pianomime.music.protocol import music_metrics

TABLE = ROOT / "tests" / "quality" / "notes.json"
PLAYER = "zero-shot"
HIGHER_IS_BETTER = {
    "note_f1_50": True,
    "note_f1_25": True,
    "velocity_f1": True,
    "phantoms_per_minute": False,
}
"""The measures, all of the `music` protocol."""
REFERENCE = ("pop/test12", "modern/test12", "etude12", "giantmidi")
"""Folders of reference data, of which the first piece is played."""
SECONDS, SECONDS_OF_EFFORT = 15.0, 10.0
LEAD_IN = 0.5
"""[s] Silence in which the hands get to their first keys."""
PLAYS = {0: 12, 1: 6}
"""How often each song is played, by effort."""


class Job(NamedTuple):
    """One song."""

    song: str
    path: Path
    effort: int
    seconds: float


def jobs(shared: Path | None) -> list[Job]:
    """All that is played.

    Args:
        shared: folder of the reference data; None leaves it out.
    """
    pieces = {name: songs.path(name) for name in songs.names()}
    often = list(pieces)[:2]
    for folder in REFERENCE if shared is not None else ():
        assert shared is not None
        file = min((shared / "data" / folder).glob("*.mid"))
        pieces[file.relative_to(shared).as_posix()] = file
    made = [Job(name, path, 0, SECONDS) for name, path in pieces.items()]
    return made + [Job(name, pieces[name], 1, SECONDS_OF_EFFORT) for name in often]


def measure(job: Job, seed: int) -> list[float]:
    """The measures of a song with a plan that differs in the last bits."""
    warnings.simplefilter("ignore")
    score = excerpt(Score.from_midi(job.path), seconds=job.seconds, lead_in=LEAD_IN)
    found = music_metrics(score, disturbed(PLAYER, job.effort, score, seed).played())
    return [float(getattr(found, name)) for name in HIGHER_IS_BETTER]


def write_notes(shared: Path | None, pool: Executor) -> None:
    """Make the table anew; without reference data, the rows that need it stay as they are."""
    table: dict[tuple[str, int], dict[str, Any]] = {}
    if TABLE.exists():
        table = {(row["song"], row["effort"]): row for row in json.loads(TABLE.read_text("utf-8"))}
    for job in jobs(shared):
        plays = PLAYS[job.effort]
        found = np.array(list(pool.map(measure, [job] * plays, range(plays))))
        row: dict[str, Any] = {
            "song": job.song,
            "effort": job.effort,
            "seconds": job.seconds,
            "lead_in": LEAD_IN,
        }
        for (name, higher), values in zip(HIGHER_IS_BETTER.items(), found.T, strict=True):
            worst = values.min() if higher else values.max()
            row[name] = {"mean": round(float(values.mean()), 6), "worst": round(float(worst), 6)}
        table[job.song, job.effort] = row
        told = ", ".join(f"{name} {row[name]['mean']:.3f}" for name in HIGHER_IS_BETTER)
        print(f"{job.song}, effort {job.effort}: {told}", flush=True)
    with atomic(TABLE) as temporary:
        temporary.write_text(json.dumps(list(table.values()), indent=1) + "\n", "utf-8")


def main() -> None:
    """Make the table alone."""
    options = parser("stored_notes", __doc__)
    options.add_argument("--jobs", type=int, default=len(cores()), help="processes (%(default)s)")
    jobs_at_once = options.parse_args().jobs
    folder = os.environ.get("PIANOMIME_SHARED")
    shared = Path(folder) if folder and Path(folder).is_dir() else None
    with ProcessPoolExecutor(jobs_at_once, get_context("spawn")) as pool:
        write_notes(shared, pool)


if __name__ == "__main__":
    main()

"""Whether every player still plays as it did, bit for bit.

Plays the bundled songs, and three pieces of Etude-12 and three modern clips more where
PIANOMIME_SHARED names reference data, at effort 0 with every player of frames that comes with the
program, and compares the controls and the F1 with those in digest.json. Controls are compared bit
for bit, which holds on one kind of processor with one set of libraries (constraints.txt); `--f1`
compares the F1 alone. On another kind of processor that of songs that are hard to play moves by
0.02.

    python benchmarks/digest.py              # compare; exit code 1 where something differs
    python benchmarks/digest.py --f1         # the F1 alone, within 0.003
    python benchmarks/digest.py --write      # make digest.json anew, and what tests compare with

Tests compare with the F1 of the zero-shot player of frames in tests/quality/f1.json, with how well
the zero-shot player plays notes (stored_notes.py), and with the plans and controls of
stored_plans.py. f1.json holds what a song comes to on many processors: the mean and the lowest F1
of many plays whose plans differ in the last bits (disturbed.py).
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
import warnings
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

import pianomime
from common import ROOT, cores, parser
from disturbed import disturbed
from pianomime import Score, load_player, songs
from pianomime.files import atomic
from pianomime.players.builtin import ZERO_SHOT_20HZ
from stored_notes import write_notes
from stored_plans import write_plans

STORED = Path(__file__).with_name("digest.json")
F1_TABLE = ROOT / "tests" / "quality" / "f1.json"
PLAYERS = (ZERO_SHOT_20HZ, "zero-shot-ik", "fingers", "two-stage-diff")
DEMONSTRATION_PLAYERS = ("demonstration", "demonstration-ik")
REFERENCE = ("etude12", "modern/test12")
Stored = dict[str, dict[str, str | float]]
TOLERANCE = 0.003
"""Of the F1: songs that are easy to play keep it where the controls differ in the last bit."""
PLAYS = {0: 16, 1: 4}
"""How often each song of f1.json is played, by effort; those of effort 1 are easy: they stay."""


class Job(NamedTuple):
    """One song for one player."""

    player: str
    effort: int
    song: str
    path: str
    seconds: float

    @property
    def name(self) -> str:
        """As it is called in the file."""
        return f"{self.player} effort {self.effort}: {self.song}, {self.seconds:g} s"


def jobs(shared: Path | None) -> list[Job]:
    """All that is played."""
    pieces = {name: str(songs.path(name)) for name in songs.names()}
    bundled = list(pieces)
    for folder in REFERENCE if shared is not None else ():
        pieces |= {
            file.stem: str(file) for file in sorted((shared / "data" / folder).glob("*.mid"))[:3]
        }
    made = [Job(player, 0, name, path, 30.0) for player in PLAYERS for name, path in pieces.items()]
    made += [Job(ZERO_SHOT_20HZ, 1, name, pieces[name], 15.0) for name in bundled[:2]]
    if shared is not None:
        clip = str(shared / "data" / "stan" / "reference.npz")
        made += [Job(player, 0, "Stan_1", clip, 30.0) for player in DEMONSTRATION_PLAYERS]
    return made


def play(job: Job) -> dict[str, str | float]:
    """The digest of the controls, and the F1."""
    warnings.simplefilter("ignore")
    if job.path.endswith(".npz"):
        from pianomime.learn.data.published import read_published

        demonstration, _ = next(iter(read_published(Path(job.path))))
        demonstration = demonstration.excerpt(0.0, job.seconds)
        # As they were recorded, as both players had them when the digests were stored.
        settings = {"planner.feasible": False} if job.player == "demonstration" else {}
        player = load_player(job.player, job.effort, demonstration=demonstration, **settings)
        score = demonstration.score
    else:
        player = pianomime.load_player(job.player, job.effort)
        score = pianomime.excerpt(pianomime.Score.from_midi(job.path), seconds=job.seconds)
    performance = player.play(score)
    digest = hashlib.sha256(performance.ctrl.tobytes()).hexdigest()[:16]
    return {"controls": digest, "f1": round(performance.metrics()["f1"], 6)}


def disturbed_f1(job: Job, seed: int) -> float:
    """The F1 of a song with a plan that differs in the last bits."""
    score = pianomime.excerpt(Score.from_midi(job.path), seconds=job.seconds)
    f1: float = disturbed(job.player, job.effort, score, seed).metrics()["f1"]
    return f1


def f1_table(
    todo: list[Job], shared: Path | None, pool: ProcessPoolExecutor
) -> list[dict[str, Any]]:
    """The rows of f1.json; without reference data, those that need it stay as they are."""
    table = {}
    if F1_TABLE.exists():
        table = {(row["song"], row["effort"]): row for row in json.loads(F1_TABLE.read_text())}
    for job in todo:
        if job.player != ZERO_SHOT_20HZ:
            continue
        song = job.song
        if song not in songs.names():
            assert shared is not None
            song = Path(job.path).relative_to(shared).as_posix()
        plays = PLAYS[job.effort]
        f1 = list(pool.map(disturbed_f1, [job] * plays, range(plays)))
        table[song, job.effort] = {
            "song": song,
            "effort": job.effort,
            "seconds": job.seconds,
            "f1": round(float(np.mean(f1)), 6),
            "lowest": round(min(f1), 6),
        }
        print(f"{np.mean(f1):.6f}  {min(f1):.6f} to {max(f1):.6f}  {job.name}", flush=True)
    return list(table.values())


def write(
    found: dict[Job, dict[str, str | float]], stored: Stored, f1: list[dict[str, Any]]
) -> None:
    """Make digest.json and f1.json anew."""
    rows = {job.name: row for job, row in found.items()}
    for path, content in ((STORED, {**stored, **rows}), (F1_TABLE, f1)):
        with atomic(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n", "utf-8")


def main() -> int:
    """Play, then compare or write."""
    arguments = parser("digest", __doc__)
    arguments.add_argument("--write", action="store_true", help="make digest.json anew")
    arguments.add_argument("--f1", action="store_true", help="compare the F1 alone")
    asked = arguments.parse_args()
    folder = os.environ.get("PIANOMIME_SHARED")
    shared = Path(folder) if folder and Path(folder).is_dir() else None
    todo = jobs(shared)
    stored: Stored = json.loads(STORED.read_text("utf-8")) if STORED.exists() else {}
    found, wrong = {}, 0
    with ProcessPoolExecutor(len(cores()), get_context("spawn")) as pool:
        for job, row in zip(todo, pool.map(play, todo), strict=True):
            found[job] = row
            known = stored.get(job.name)
            if known is None:
                verdict = "new"
            elif asked.f1:
                verdict = "as before" if abs(known["f1"] - row["f1"]) <= TOLERANCE else "DIFFERS"
            else:
                verdict = "as before" if known == row else f"DIFFERS from {known}"
            wrong += verdict.startswith("DIFFERS") or (verdict == "new" and not asked.write)
            print(f"{row['controls']}  {row['f1']:.6f}  {verdict}  {job.name}", flush=True)
        if asked.write:
            write(found, stored, f1_table(todo, shared, pool))
            write_notes(shared, pool)
    if asked.write:
        write_plans()
        return 0
    print(f"{len(found) - wrong} of {len(found)} as before")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())

"""What the page of a report costs: its size, the time until it can be used, its work, its memory.

Plays a bundled song of 30 s, and one again and again for ten minutes, writes their reports, and
opens each in a headless Chromium that renders in software, in a process of its own.

    python benchmarks/page.py
    python benchmarks/page.py --minutes 1     # as a trial
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import common

sys.path.insert(0, str(common.ROOT / "tests"))

from browser import Browsers, browsers
from pianomime import Score, excerpt, load_player, songs
from pianomime.keyboard import LEAD_IN_SECONDS
from pianomime.progress import no_progress
from pianomime.report import write_report

SONG = "bach-prelude-c"
SECONDS = 30.0
REPEATS = 5
WATCHED = 5.0
"""[s] of playing, over which the work of the page is a mean."""
REPLAY = "document.querySelector('pianomime-replay')"


def main() -> None:
    """Make both reports, measure, and print a table."""
    parser = common.parser("page", __doc__)
    parser.add_argument(
        "--minutes", type=float, default=10.0, help="of the long piece (%(default)s)"
    )
    options = parser.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    results: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name, browsers() as started:
        for label, score in (("30 s", short()), ("long", long(60 * options.minutes))):
            page = report(score, Path(name, label.replace(" ", "")))
            results[label] = {
                "seconds": score.duration,
                "megabytes": page.stat().st_size / 1e6,
                **watch(started, page.as_uri()),
            }
    print("| | 30 s | long |\n| --- | ---: | ---: |")
    for what in results["30 s"]:
        print(f"| {what} | " + " | ".join(f"{row[what]:.2f}" for row in results.values()) + " |")
    common.report(options.output, facts, results)


def short() -> Score:
    """The first 30 s of a song."""
    return excerpt(Score.from_midi(songs.path(SONG)), seconds=SECONDS, lead_in=LEAD_IN_SECONDS)


def long(seconds: float) -> Score:
    """A song, again and again."""
    score = Score.from_midi(songs.path(SONG))
    times = int(np.ceil(seconds / score.duration))
    later = np.arange(times)[:, None] * score.duration
    onset, offset = ((times_ + later).ravel() for times_ in (score.onset, score.offset))
    key, velocity = (np.tile(part, times) for part in (score.key, score.velocity))
    return excerpt(Score(key, onset, offset, velocity, title="again and again"), seconds=seconds)


def report(score: Score, folder: Path) -> Path:
    """Play in one pass and write the report; its page."""
    folder.mkdir()
    performance = load_player("zero-shot", effort=0).play(score)
    write_report(performance, folder, False, no_progress, sys.exit)
    return folder / "report.html"


def watch(started: Browsers, address: str) -> dict[str, float]:
    """Open the page some times, and play once."""
    opened = []
    for _ in range(REPEATS):
        with started.chromium() as chromium:
            page = chromium.new_page(viewport={"width": 1280, "height": 900})
            page.goto(address, wait_until="commit")
            page.wait_for_function(f"{REPLAY}?.ready !== undefined")
            # From the beginning of the navigation until the first picture.
            opened.append(page.evaluate(f"{REPLAY}.ready.then(() => performance.now())") / 1000)
            if len(opened) < REPEATS:
                continue
            page.evaluate(f"{REPLAY}.play()")
            page.wait_for_timeout(WATCHED * 1000)
            cost = page.evaluate(f"{REPLAY}.stepCost()")
            page.evaluate(f"{REPLAY}.currentTime = {REPLAY}.duration - {WATCHED + 1}")
            page.wait_for_timeout(WATCHED * 1000)
            memory = renderer_memory()
    return {
        "until it can be used [s]": statistics.median(opened),
        "work of the page a picture [ms]": cost,
        "memory of the page's process [MB]": memory,
    }


def renderer_memory() -> float:
    """Memory of the process that has the page, what it shares with others left out [MB]."""
    most = 0.0
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if b"--type=renderer" in (process / "cmdline").read_bytes():
                lines = (process / "smaps_rollup").read_text().splitlines()
                private = sum(int(line.split()[1]) for line in lines if line.startswith("Private_"))
                most = max(most, private / 1000)
        except OSError:
            continue
    return most


if __name__ == "__main__":
    main()

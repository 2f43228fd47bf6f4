"""How soon a song that is dropped on the stage is heard, and how long `play` takes up to its page.

Drops the first 30 s of songs on the stage's page in a headless Chromium that renders in software,
at effort 0, and waits until sound comes; the stage has stood for a while, as it does for a user.
Then plays the first of them with `pianomime play` at the default effort.

    python benchmarks/stage.py
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import common

sys.path.insert(0, str(common.ROOT / "tests"))

from browser import Browsers, browsers
from pianomime import Score, excerpt, songs
from pianomime.keyboard import LEAD_IN_SECONDS
from pianomime.stage.server import Stage

SONGS = ("bach-prelude-c", "beethoven-ode-to-joy", "petzold-minuet-g")
SECONDS = 30.0
STANDS = 15.0
"""[s] The stage stands before the first song is dropped."""
REPLAY = "document.querySelector('pianomime-replay')"


def main() -> None:
    """Measure and print a table."""
    parser = common.parser("stage", __doc__)
    options = parser.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    with tempfile.TemporaryDirectory() as name, browsers() as started:
        folder = Path(name)
        heard = {song: first_sound(started, song, folder) for song in SONGS}
        began = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "pianomime", "play", SONGS[0], "-o", str(folder / "played")],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        played = time.perf_counter() - began
    print("| | [s] |\n| --- | ---: |")
    for song, seconds in heard.items():
        print(f"| from drop to first sound, effort 0: {song} | {seconds:.1f} |")
    print(f"| `pianomime play {SONGS[0]}`, from command to page | {played:.1f} |")
    results: dict[str, Any] = {
        "first_sound": heard,
        "median": statistics.median(heard.values()),
        "play": played,
    }
    common.report(options.output, facts, results)


def first_sound(started: Browsers, song: str, folder: Path) -> float:
    """Seconds from the drop of a song to its first sound."""
    path = folder / f"{song}.mid"
    excerpt(Score.from_midi(songs.path(song)), seconds=SECONDS).to_midi(path)
    with Stage(folder / f"out-{song}", []) as stage, started.chromium() as chromium:
        page = chromium.new_context(bypass_csp=True).new_page()
        page.goto(stage.url)
        page.wait_for_selector("nav li")
        time.sleep(STANDS)
        began = time.perf_counter()
        page.set_input_files("input[type=file]", path)
        page.wait_for_function(
            f"{REPLAY}.currentTime > {LEAD_IN_SECONDS + 0.02}", polling=20, timeout=120_000
        )
        return time.perf_counter() - began


if __name__ == "__main__":
    main()

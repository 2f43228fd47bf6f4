"""Real films whose keys light up and that do not: what they are called, and what is read of them.

    python benchmarks/lit_keys.py

PIANOMIME_SHARED names the folder of reference data. Each film is read twice: with its hands
(`pianomime retarget --notes light`; needs MediaPipe), and from its pictures alone
(`notes_of_lit_film`). The truth is a MIDI file at the offset that `retarget` finds; where there is
none, F1 is nan.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import common
from pianomime.errors import InputError
from pianomime.music import Score, onset_f1
from pianomime.video.lit_film import notes_of_lit_film
from pianomime.video.retarget import RetargetConfig, retarget

FILMS: tuple[tuple[str, str | None], ...] = (
    ("stan/Stan_1.mp4", "stan/Stan_1.mid"),
    ("video/films/falling-notes-no-hands.mp4", None),
    ("video/films/unlit-overhead.mp4", "video/films/unlit-overhead-transcribed.mid"),
    ("video/films/hover-one-hand.mp4", None),
    ("video/films/two-octaves-angled.mp4", None),
)


def main() -> None:
    options = common.parser("lit_keys", __doc__)
    given = options.parse_args()
    shared = common.shared()
    model = shared / "models" / "hand_landmarker.task"
    facts = common.machine()
    common.show_machine(facts)
    rows = []
    for film, midi in FILMS:
        video = shared / "data" / film
        truth = None if midi is None else _truth(video, shared / "data" / midi, model)
        for way, read in (
            ("with hands", partial(_with_hands, model=model)),
            ("pictures alone", notes_of_lit_film),
        ):
            rows.append(_row(video, way, read, truth))
    common.table(list(rows[0]), [list(row.values()) for row in rows])
    common.report(given.output, facts, {"films": rows})


def _truth(video: Path, midi: Path, model: Path) -> Score:
    """The notes of a MIDI file in the time of its film."""
    return retarget(video, RetargetConfig(midi=midi, hand_model=model)).demonstration.score


def _with_hands(video: Path, model: Path) -> Score:
    config = RetargetConfig(hand_model=model, notes="light")
    return retarget(video, config).demonstration.score


def _row(video: Path, way: str, read: Any, truth: Score | None) -> dict[str, Any]:
    score, said = None, "lit"
    try:
        score = read(video)
    except InputError as error:
        # Without advice, and without the path of the film.
        said = re.split("[,;:]", str(error).removeprefix(f"{video}: "))[0]
    f1 = float("nan")
    if truth is not None:
        # After the end of the MIDI file the music in the film goes on, and nothing is known of it.
        last = truth.onset.max() + 0.1
        heard = [] if score is None else score.onset <= last
        pairs = ([], []) if score is None else (score.key[heard], score.onset[heard])
        f1 = onset_f1((truth.key, truth.onset), pairs, 0.1)
    return {
        "film": video.stem,
        "read": way,
        "called": said,
        "notes": 0 if score is None else len(score),
        "onset F1 (100 ms)": f1,
    }


if __name__ == "__main__":
    main()

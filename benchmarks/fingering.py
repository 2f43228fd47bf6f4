"""Agreement of the fingering search with human fingerings.

Needs the reference data (PIANOMIME_SHARED names its folder): the fingered pieces of two sets,
whole, and the held-out clips of pianists, whose fingering was read from their hands. The costs of
the search are set by hand for the F1 of the performance, and fitted to none of these fingerings
(`fit_fingering.py` tries whether that would help).

- played: share of the notes that the search assigns to a finger.
- same hand, same finger: share of all notes with the same hand, or hand and finger, as in the human
  fingering; a note that the search drops counts as different.
- same finger in the same hand: share of the notes with the same hand.

There is more than one good fingering, and people differ too, so that 1 is not the aim.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import common
from pianomime.keyboard import KEYS, LOWEST_PITCH
from pianomime.music import Score
from pianomime.plan.fingering import find_fingering
from pianomime.plan.fingering_cost import FingeringConfig
from pianomime.plan.fingertip_plan import LEFT, RIGHT

_SAME_TIME = 0.005
"""[s] Greatest distance of a note of a fingering from the same note of the MIDI file."""
_SETS = ("etude12", "repertoire", "clips")


class Piece(NamedTuple):
    """A score with a human fingering.

    Attributes:
        score: N notes.
        hand, finger: (N,) as in a FingertipPlan; -1 where that of the human is unknown.
    """

    score: Score
    hand: NDArray[np.int64]
    finger: NDArray[np.int64]


class Count(NamedTuple):
    """Notes of one piece."""

    notes: int
    known: int
    played: int
    same_hand: int
    same_finger: int


def fingered(folder: Path) -> Iterator[Piece]:
    """The pieces of a folder with a `fingering.json`."""
    rows = json.loads((folder / "fingering.json").read_text("utf-8"))["pieces"]
    for name in sorted(rows):
        score = Score.from_midi(folder / f"{name}.mid")
        hand, finger = np.full((2, len(score)), -1)
        for start, _, pitch, _, number in rows[name]:
            time = np.where(score.key == pitch - LOWEST_PITCH, np.abs(score.onset - start), np.inf)
            note = int(time.argmin())
            if time[note] < _SAME_TIME:
                side, finger[note] = divmod(number, 5)
                hand[note] = LEFT if side else RIGHT
        yield Piece(score, hand, finger)


def clips(shared: Path) -> Iterator[Piece]:
    """The held-out clips: the finger that is on a note's key for most of its frames."""
    with np.load(shared / "data" / "pianomime" / "demonstrations.npz") as file:
        human = dict(file)
    ends = np.cumsum(human["length"])
    for clip in np.flatnonzero(human["split"] == "test"):
        rows = slice(ends[clip] - human["length"][clip], ends[clip])
        goal = np.unpackbits(human["goal_packed"][rows], axis=1)[:, :KEYS].astype(bool)
        score = Score.from_roll(goal)
        hand, finger = np.full((2, len(score)), -1)
        for note, (first, stop) in enumerate(score.note_frames()):
            frames = (human["finger_key"][rows][first:stop] == score.key[note]).sum(axis=0)
            if frames.any():
                hand[note], finger[note] = np.unravel_index(frames.argmax(), frames.shape)
        yield Piece(score, hand, finger)


def compare(piece: Piece, config: FingeringConfig | None = None) -> Count:
    """How far the search and the human agree."""
    found = find_fingering(piece.score, config)
    known = piece.hand >= 0
    same_hand = known & (found.hand == piece.hand)
    same_finger = same_hand & (found.finger == piece.finger)
    played = known & (found.hand >= 0)
    return Count(
        len(known), *(int(which.sum()) for which in (known, played, same_hand, same_finger))
    )


def main() -> None:
    arguments = common.parser("fingering", __doc__).parse_args()
    shared = common.shared()
    facts = common.machine()
    common.show_machine(facts)
    sets: dict[str, Any] = {}
    with ProcessPoolExecutor(len(common.cores())) as pool:
        for name in _SETS:
            pieces = clips(shared) if name == "clips" else fingered(shared / "data" / name)
            counts = list(pool.map(compare, pieces))
            total = Count(*(sum(column) for column in zip(*counts, strict=True)))
            sets[name] = {
                "pieces": len(counts),
                "notes": total.notes,
                "with human fingering": total.known,
                "played": total.played / total.known,
                "same hand": total.same_hand / total.known,
                "same finger": total.same_finger / total.known,
                "same finger in the same hand": total.same_finger / total.same_hand,
            }
    heads = ["set", *sets[_SETS[0]]]
    common.table(heads, [[name, *row.values()] for name, row in sets.items()])
    common.report(arguments.output, facts, {"sets": sets})


if __name__ == "__main__":
    main()

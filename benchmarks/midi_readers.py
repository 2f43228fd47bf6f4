"""Compare how MIDI files are read, note by note, with two independent readers.

    python benchmarks/midi_readers.py FOLDER...

pretty_midi (whose parser is mido) and symusic read the same files. Files are listed on which these
two agree and we differ: in strikes (a key at a time), in the ends of notes, or in presses of the
pedal, with what was told while the file was read. Files that one of them reads and we do not, and
strikes that either finds and we do not, are listed too.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pretty_midi
import symusic
from numpy.typing import NDArray

from pianomime.keyboard import KEYS, LOWEST_PITCH
from pianomime.music import Score
from pianomime.songs.find import find_songs

PEDAL = 64
SAME = 0.002
"""[s] Times that differ by less are the same: symusic's are float32."""


@dataclass
class Reading:
    """What a reader finds; tables are sorted by key and time.

    Attributes:
        strikes: (N, 2) key and onset [s].
        ends: (N, 2) key and offset [s].
        presses: (P,) when the pedal goes down before the last note ends [s].
        remarks: what the reader told.
    """

    strikes: NDArray[np.float64]
    ends: NDArray[np.float64]
    presses: NDArray[np.float64]
    remarks: tuple[str, ...] = ()


def reading(notes: list[tuple[int, float, float]], pedal: list[tuple[float, int]]) -> Reading:
    """Sort what was read; notes that strike one key at one instant are one, the longest."""
    longest: dict[tuple[int, float], float] = {}
    for pitch, onset, offset in notes:
        place = pitch - LOWEST_PITCH, round(onset, 6)
        if 0 <= place[0] < KEYS:
            longest[place] = max(longest.get(place, 0.0), offset)
    down = np.array([value >= PEDAL for _, value in sorted(pedal, key=lambda each: each[0])], int)
    times = np.array(sorted(time for time, _ in pedal))
    presses = times[np.diff(down, prepend=0) == 1]
    return Reading(
        strikes=np.array(sorted(longest)).reshape(-1, 2),
        ends=np.array(sorted((key, end) for (key, _), end in longest.items())).reshape(-1, 2),
        # Tracks that press one pedal at one instant press it once.
        presses=np.unique(presses[presses < max(longest.values(), default=0.0) - SAME].round(3)),
    )


def with_pretty_midi(path: Path) -> Reading:
    tracks = [each for each in pretty_midi.PrettyMIDI(str(path)).instruments if not each.is_drum]
    return reading(
        [(note.pitch, note.start, note.end) for track in tracks for note in track.notes],
        [
            (change.time, change.value)
            for track in tracks
            for change in track.control_changes
            if change.number == PEDAL
        ],
    )


def with_symusic(path: Path) -> Reading:
    file = symusic.Score(str(path), ttype="second")
    tracks = [each for each in file.tracks if not each.is_drum]
    return reading(
        [(note.pitch, note.start, note.end) for track in tracks for note in track.notes],
        [
            (change.time, change.value)
            for track in tracks
            for change in track.controls
            if change.number == PEDAL
        ],
    )


def with_ours(path: Path) -> Reading:
    score = Score.from_midi(path)
    notes = zip((score.key + LOWEST_PITCH).tolist(), score.onset, score.offset, strict=True)
    pedal = [(time, value) for on, off in score.pedal for time, value in ((on, 127), (off, 0))]
    made = reading(list(notes), pedal)
    made.remarks = score.remarks
    return made


def attempt(read: Callable[[Path], Reading], path: Path) -> Reading | None:
    """What a reader finds, or None where it refuses the file."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return read(path)
        except Exception:  # whatever a reader does with a damaged file
            return None


def same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    return one.shape == other.shape and bool((np.abs(one - other) < SAME).all())


def lost(ours: Reading, other: Reading) -> int:
    """Strikes of the other reader that are missing in ours, key by key, wherever in time."""
    mine, theirs = (
        np.bincount(each.strikes[:, 0].astype(int), minlength=KEYS) for each in (ours, other)
    )
    return int(np.maximum(theirs - mine, 0).sum())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folders", nargs="+", type=Path)
    options = parser.parse_args()
    files = find_songs(options.folders)
    counts: Counter[str] = Counter()
    for file in files:
        ours, one, other = (
            attempt(read, file) for read in (with_ours, with_pretty_midi, with_symusic)
        )
        counts["files"] += 1
        for name, found in (("us", ours), ("pretty_midi", one), ("symusic", other)):
            counts[f"refused by {name}"] += found is None
        if ours is None:
            if any(each is not None and len(each.strikes) for each in (one, other)):
                print(f"{file}: refused, unlike others")
                counts["refused by us alone"] += 1
            continue
        kinds = []
        if one is not None and other is not None:
            for kind in ("strikes", "ends", "presses"):
                mine, theirs = getattr(ours, kind), getattr(one, kind)
                if not same(theirs, getattr(other, kind)):
                    counts[f"{kind}: the two others differ"] += 1
                elif not same(mine, theirs):
                    counts[f"{kind}: they agree, we differ"] += 1
                    kinds.append(f"{kind} {len(mine)}, others {len(theirs)}")
        missed = max(lost(ours, each) for each in (one, other) if each) if one or other else 0
        if missed:
            kinds.append(f"{missed} strikes that another finds")
            counts["a strike that another finds is missing"] += 1
        pressed = max((len(each.presses) for each in (one, other) if each), default=0)
        if len(ours.presses) < pressed:
            kinds.append(f"presses {len(ours.presses)}, another {pressed}")
            counts["fewer presses than another"] += 1
        if ours.remarks:
            counts["read with a remark"] += 1
        if kinds:
            counts["different, without a remark"] += not ours.remarks
            print(f"{file}: {'; '.join(kinds)} | {'; '.join(ours.remarks) or 'no remark'}")
    for name, count in counts.items():
        print(f"{count:6d} {name}")


if __name__ == "__main__":
    main()

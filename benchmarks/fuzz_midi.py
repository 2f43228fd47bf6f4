"""Read random and mutated MIDI files: nothing but a Score or an InputError may come of them.

    python benchmarks/fuzz_midi.py --count 100000

Mutations are changes of bytes, pieces taken out, doubled or moved, and cuts, in the bundled songs
(cut to their beginning, so that headers are hit often), in files of the given folders, and in short
files with all kinds of events. What is read must be consistent: it has a roll and can be written.
"""

from __future__ import annotations

import argparse
import random
import struct
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from pianomime import songs
from pianomime.errors import InputError
from pianomime.music import Score

LONGEST = 1500
"""Bytes of a file that is mutated: reading takes time by the byte."""
EVENTS = (
    b"\x00\x90\x3c\x50\x83\x60\x80\x3c\x40",
    b"\x00\x90\x40\x50\x60\x40\x00",
    b"\x00\xb0\x40\x7f\x60\xb0\x40\x00",
    b"\x00\xb0\x65\x00\x00\xb0\x64\x02\x00\xb0\x06\x4c",
    b"\x00\xb0\x79\x00\x00\xb0\x7b\x00",
    b"\x00\xc0\x05\x00\xd0\x10\x00\xe0\x00\x40\x00\xa0\x3c\x10",
    b"\x00\xff\x51\x03\x07\xa1\x20",
    b"\x00\xff\x21\x01\x01\x00\xff\x03\x02ab",
    b"\x00\xf0\x05\x7e\x7f\x09\x01\xf7\x00\xf0\x03\x43\x12\x00\x0a\xf7\x03\x43\x12\xf7",
    b"\x00\xf0\x0a\x41\x10\x42\x12\x40\x1a\x15\x01\x10\xf7",
    b"\x00\xf7\x02\xf3\x01\x00\xf4\x00\xf8",
    b"\x00\xff\x2f\x00",
)


def made(random: random.Random) -> bytes:
    """A short file of random events and header."""
    tracks = []
    for _ in range(random.randint(0, 4)):
        content = b"".join(random.choices(EVENTS, k=random.randint(0, 12))) + EVENTS[-1]
        tracks.append(b"MTrk" + struct.pack(">I", len(content)) + content)
    division = random.choice((480, 96, 0xE728, 0xE350, random.randrange(1 << 16)))
    kind, count = random.choice((0, 1, 2)), random.choice((len(tracks), random.randrange(9)))
    return b"MThd" + struct.pack(">IHHH", 6, kind, count, division) + b"".join(tracks)


def mutated(content: bytearray, random: random.Random) -> bytes:
    """A file with a few changes."""
    for _ in range(random.choice((0, 1, 1, 2, 4, 16))):
        if not content:
            break
        at = random.randrange(len(content))
        end = min(at + random.choice((1, 2, 4, 30)), len(content))
        match random.randrange(6):
            case 0:
                content[at] = random.randrange(256)
            case 1:
                content[at] ^= 1 << random.randrange(8)
            case 2:
                del content[at:end]
            case 3:
                content[at:at] = content[at:end]
            case 4:
                content[at:at] = random.randbytes(end - at)
            case 5:
                del content[at:]
    return bytes(content)


def fuzz(count: int, seed: int, folders: Sequence[Path] = ()) -> tuple[Counter[str], Counter[str]]:
    """Read files, and count what came of them.

    Args:
        count: number of files.
        seed: of their making.
        folders: with more MIDI files to mutate.

    Returns:
        What was read and refused, and faults.
    """
    files = [songs.path(name) for name in songs.names()]
    files += [file for folder in folders for file in sorted(folder.rglob("*.mid"))]
    originals = [file.read_bytes()[:LONGEST] for file in files]
    choose = random.Random(seed)
    counts: Counter[str] = Counter()
    faults: Counter[str] = Counter()
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "song.mid")
        for index in range(count):
            kind = choose.randrange(8)
            if kind == 0:
                content = choose.randbytes(choose.randrange(200))
            elif kind == 1:
                content = b"MThd" + choose.randbytes(choose.randrange(200))
            elif kind < 5:
                content = mutated(bytearray(made(choose)), choose)
            else:
                content = mutated(bytearray(choose.choice(originals)), choose)
            path.write_bytes(content)
            try:
                counts[outcome(path, use=index % 4 == 0)] += 1
            except Exception as error:
                where = traceback.extract_tb(error.__traceback__)[-1]
                reason = f"{type(error).__name__}: {error} ({where.name}:{where.lineno})"
                if not faults[reason]:
                    print(f"{reason}\n    {content.hex()}")
                faults[reason] += 1
            if (index + 1) % 10_000 == 0:
                print(f"{index + 1:7d} files, {time.perf_counter() - began:.0f} s", flush=True)
    return counts, faults


def outcome(path: Path, use: bool) -> str:
    """Read a file, and use what was read; any exception of this function is a fault."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            score = Score.from_midi(path)
        except InputError as error:
            if "\n" in str(error):
                raise AssertionError("an error of several lines") from error
            return "refused"
    assert len(score), "no notes"
    assert len(told) == bool(score.remarks), "a remark without a warning"
    if use and score.duration < 60:
        score.roll()
        score.pedal_roll()
        score.to_midi(path)
    return "read with a remark" if score.remarks else "read"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("folders", nargs="*", type=Path, help="with more MIDI files to mutate")
    options = parser.parse_args()
    counts, faults = fuzz(options.count, options.seed, options.folders)
    for name, count in (*counts.items(), *faults.items()):
        print(f"{count:7d} {name}")
    print(f"{faults.total():7d} faults in {options.count} files, seed {options.seed}")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()

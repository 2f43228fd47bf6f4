"""The bundled songs as text, and the reader of that notation.

A voice is a sequence of notes. `E4` is a note (C4 is the middle C; `#` and `b` as usual),
`C4+E4+G4` a chord, `r` a rest, and in a pedal line `P` is the pedal down. `*1.5` after any of these
is its length in beats; without it, it lasts one unit of the voice. `|` marks the end of a bar (or
of several, over which a note is held); a bar that does not add up is an error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pianomime.keyboard import LOWEST_PITCH
from pianomime.music import Score, ScoreError

SEMITONES = {"C": 0, "D": 2, "E": 4, "F": 5, "G": 7, "A": 9, "B": 11}
RELEASE = 0.05
"""[s] Time by which every note ends early, so that its key can be struck again."""


@dataclass(frozen=True)
class Voice:
    """One line of music.

    Attributes:
        text: notes as described above.
        unit: length of a note that names none [beats].
        velocity: how hard it is struck; the first beat of a bar is struck harder by 8.
    """

    text: str
    unit: float = 1.0
    velocity: int = 64


@dataclass(frozen=True)
class Piece:
    """A piece.

    Attributes:
        title: its name.
        tempo: beats per minute.
        bar: beats in a bar.
        voices: the lines that sound together.
        pedal: a line of `P` and `r`.
        upbeat: beats before the first full bar.
    """

    title: str
    tempo: float
    bar: float
    voices: tuple[Voice, ...]
    pedal: str = ""
    upbeat: float = 0.0


def to_score(piece: Piece) -> Score:
    """Read a piece.

    Args:
        piece: a piece in this notation.

    Raises:
        ScoreError: a note is misspelt or a bar does not add up.
    """
    beat = 60 / piece.tempo
    notes: list[tuple[int, float, float, int]] = []
    for voice in piece.voices:
        for names, start, length in _events(piece, voice.text, voice.unit):
            onset, seconds = start * beat, length * beat
            accent = 8 if (start - piece.upbeat) % piece.bar == 0 else 0
            for name in names:
                # A short note keeps at least half its length.
                offset = onset + max(seconds - RELEASE, seconds / 2)
                notes.append((_key(name), onset, offset, voice.velocity + accent))
    keys, onsets, offsets, velocities = zip(*notes, strict=True)
    pedal = [
        (start * beat, (start + length) * beat - RELEASE)
        for _, start, length in _events(piece, piece.pedal, piece.bar)
    ]
    return Score(
        key=np.array(keys),
        onset=np.array(onsets),
        offset=np.array(offsets),
        velocity=np.array(velocities),
        pedal=np.array(pedal),
        title=piece.title,
    )


def _events(piece: Piece, text: str, unit: float) -> list[tuple[list[str], float, float]]:
    """Notes of one line: names, start and length; both times in beats."""
    events = []
    start, now, bar_end = 0.0, 0.0, piece.upbeat or piece.bar
    for token in text.split():
        if token == "|":
            if now < bar_end or start >= bar_end or (now - bar_end) % piece.bar:
                raise ScoreError(f"{piece.title}: bar ends at beat {now}, not {bar_end}")
            bar_end = now + piece.bar
            continue
        name, _, length = token.partition("*")
        beats = float(length) if length else unit
        if name != "r":
            events.append((name.split("+"), now, beats))
        start, now = now, now + beats
    return events


def _key(name: str) -> int:
    """Key 0..87 of a note such as F#4."""
    letter, accidental, octave = name[0], name[1:-1], name[-1]
    if letter not in SEMITONES or accidental not in ("", "#", "b") or not octave.isdigit():
        raise ScoreError(f"no such note: {name}")
    semitone = SEMITONES[letter] + accidental.count("#") - accidental.count("b")
    return 12 * (int(octave) + 1) + semitone - LOWEST_PITCH


def _bach_prelude() -> Piece:
    """Every bar but the last three breaks a chord of five notes, twice."""
    chords = """
        C4 E4 G4 C5 E5    C4 D4 A4 D5 F5    B3 D4 G4 D5 F5    C4 E4 G4 C5 E5
        C4 E4 A4 E5 A5    C4 D4 F#4 A4 D5   B3 D4 G4 D5 G5    B3 C4 E4 G4 C5
        A3 C4 E4 G4 C5    D3 A3 D4 F#4 C5   G3 B3 D4 G4 B4    G3 Bb3 E4 G4 C#5
        F3 A3 D4 A4 D5    F3 Ab3 D4 F4 B4   E3 G3 C4 G4 C5    E3 F3 A3 C4 F4
        D3 F3 A3 C4 F4    G2 D3 G3 B3 F4    C3 E3 G3 C4 E4    C3 G3 Bb3 C4 E4
        F2 F3 A3 C4 E4    F#2 C3 A3 C4 Eb4  Ab2 F3 B3 C4 D4   G2 F3 G3 B3 D4
        G2 E3 G3 C4 E4    G2 D3 G3 C4 F4    G2 D3 G3 B3 F4    G2 Eb3 A3 C4 F#4
        G2 E3 G3 C4 G4    G2 D3 G3 C4 F4    G2 D3 G3 B3 F4    C2 C3 G3 Bb3 E4
    """
    bass, tenor, upper = "", "", ""
    notes = iter(chords.split())
    for a, b, c, d, e in zip(notes, notes, notes, notes, notes, strict=True):
        bass += f"{a}*2 {a}*2 | "
        tenor += f"r {b}*1.75 r {b}*1.75 | "
        upper += f"r r {c} {d} {e} {c} {d} {e} " * 2 + "| "
    bass += "C2*4 | C2*4 | C2*4 |"
    tenor += "r C3*3.75 | r B2*3.75 | C3*4 |"
    upper += """
        r r F3 A3 C4 F4 C4 A3 C4 A3 F3 A3 F3 D3 F3 D3 |
        r r G4 B4 D5 F5 D5 B4 D5 B4 G4 B4 D4 F4 E4 D4 |
        E4+G4+C5*4 |
    """
    return Piece(
        title="J. S. Bach: Prelude in C major, BWV 846",
        tempo=66,
        bar=4,
        voices=(Voice(bass, 1, 56), Voice(tenor, 0.25, 52), Voice(upper, 0.25, 56)),
        pedal="P | " * 35,
    )


def _c_major_study() -> Piece:
    """Both hands an octave apart."""
    right = """
        C4 D4 E4 F4 G4 A4 B4 C5 | D5 E5 F5 G5 A5 B5 C6 B5 | A5 G5 F5 E5 D5 C5 B4 A4 |
        G4 F4 E4 D4 C4*2 | C4 E4 G4 C5 E5 G5 C6 G5 | E5 C5 G4 E4 C4*2 | C4+E4+G4*4 |
    """
    left = "".join(str(int(sign) - 1) if sign in "3456" else sign for sign in right)
    # Lengths are digits too, and the left hand's last chord is open.
    left = left.replace("*3 |", "*4 |").replace("C3+E3+G3", "C3+G3")
    return Piece(
        title="Scale and arpeggio in C major",
        tempo=96,
        bar=4,
        voices=(Voice(right, 0.5, 68), Voice(left, 0.5, 62)),
    )


def _twinkle() -> Piece:
    broken = {
        "C": "C3 G3 E3 G3 ",
        "F": "C3 A3 F3 A3 ",
        "G": "B2 G3 F3 G3 ",
    }
    verse = ["CC", "FC", "FC", "GC"]
    middle = ["CF", "CG", "CF", "CG"]
    left = "".join("".join(broken[chord] for chord in bar) + "| " for bar in verse + middle + verse)
    right = """
        C4 C4 G4 G4 | A4 A4 G4*2 | F4 F4 E4 E4 | D4 D4 C4*2 |
        G4 G4 F4 F4 | E4 E4 D4*2 | G4 G4 F4 F4 | E4 E4 D4*2 |
        C4 C4 G4 G4 | A4 A4 G4*2 | F4 F4 E4 E4 | D4 D4 C4*2 |
    """
    return Piece(
        title="Twinkle, Twinkle, Little Star",
        tempo=100,
        bar=4,
        voices=(Voice(right, 1, 72), Voice(left, 0.5, 52)),
    )


SONGS = {
    "bach-prelude-c": _bach_prelude(),
    "beethoven-fur-elise": Piece(
        title="L. van Beethoven: Für Elise, opening",
        tempo=70,
        bar=1.5,
        upbeat=0.5,
        voices=(
            Voice(
                """
                E5 D#5 |
                E5 D#5 E5 B4 D5 C5 | A4*.5 r C4 E4 A4 | B4*.5 r E4 G#4 B4 | C5*.5 r E4 E5 D#5 |
                E5 D#5 E5 B4 D5 C5 | A4*.5 r C4 E4 A4 | B4*.5 r E4 C5 B4 | A4*.5 r r E5 D#5 |
                E5 D#5 E5 B4 D5 C5 | A4*.5 r C4 E4 A4 | B4*.5 r E4 G#4 B4 | C5*.5 r E4 E5 D#5 |
                E5 D#5 E5 B4 D5 C5 | A4*.5 r C4 E4 A4 | B4*.5 r E4 C5 B4 | A4*1.5 |
                """,
                unit=0.25,
                velocity=58,
            ),
            Voice(
                "r r | "
                + """
                r*1.5 | A2 E3 A3 r*.75 | E2 E3 G#3 r*.75 | A2 E3 A3 r*.75 |
                r*1.5 | A2 E3 A3 r*.75 | E2 E3 G#3 r*.75 | A2 E3 A3 r*.75 |
                """
                * 2,
                unit=0.25,
                velocity=50,
            ),
        ),
        pedal="r*.5 | " + "r | P*1 r*.5 | P*1 r*.5 | P*1 r*.5 | " * 4,
    ),
    "beethoven-ode-to-joy": Piece(
        title="L. van Beethoven: Ode to Joy",
        tempo=108,
        bar=4,
        voices=(
            Voice(
                """
                E4 E4 F4 G4 | G4 F4 E4 D4 | C4 C4 D4 E4 | E4*1.5 D4*.5 D4*2 |
                E4 E4 F4 G4 | G4 F4 E4 D4 | C4 C4 D4 E4 | D4*1.5 C4*.5 C4*2 |
                D4 D4 E4 C4 | D4 E4*.5 F4*.5 E4 C4 | D4 E4*.5 F4*.5 E4 D4 | C4 D4 G3*2 |
                E4 E4 F4 G4 | G4 F4 E4 D4 | C4 C4 D4 E4 | D4*1.5 C4*.5 C4*2 |
                """,
                velocity=76,
            ),
            Voice(
                """
                C3+E3 C3+E3 | C3+E3 G2+F3 | C3+E3 C3+G3 | C3+G3 G2+F3 |
                C3+E3 C3+E3 | C3+E3 G2+F3 | C3+E3 C3+G3 | G2+F3 C3+E3 |
                G2+B2 C3+E3 | G2+B2 C3+E3 | G2+B2 C3+E3 | A2+E3*1 D3+F#3*1 G2+B2 |
                C3+E3 C3+E3 | C3+E3 G2+F3 | C3+E3 C3+G3 | G2+F3 C3+E3 |
                """,
                unit=2,
                velocity=56,
            ),
        ),
    ),
    "c-major-study": _c_major_study(),
    "petzold-minuet-g": Piece(
        title="C. Petzold: Minuet in G major, BWV Anh. 114, first part",
        tempo=112,
        bar=3,
        voices=(
            Voice(
                """
                D5*1 G4 A4 B4 C5 | D5*1 G4*1 G4*1 | E5*1 C5 D5 E5 F#5 | G5*1 G4*1 G4*1 |
                C5*1 D5 C5 B4 A4 | B4*1 C5 B4 A4 G4 | F#4*1 G4 A4 B4 G4 | A4*3 |
                D5*1 G4 A4 B4 C5 | D5*1 G4*1 G4*1 | E5*1 C5 D5 E5 F#5 | G5*1 G4*1 G4*1 |
                C5*1 D5 C5 B4 A4 | B4*1 C5 B4 A4 G4 | A4*1 B4 A4 G4 F#4 | G4*3 |
                """,
                unit=0.5,
                velocity=70,
            ),
            Voice(
                """
                G3+B3+D4*2 A3*1 | B3*3 | C4*3 | B3*3 |
                A3*3 | G3*3 | D4*1 B3*1 G3*1 | D4*1 D3 C4 B3 A3 |
                B3*2 A3*1 | G3*1 B3*1 G3*1 | C4*3 | B3*1 C4 B3 A3 G3 |
                A3*2 F#3*1 | G3*2 B3*1 | C4*1 D4*1 D3*1 | G3*2 G2*1 |
                """,
                unit=0.5,
                velocity=58,
            ),
        ),
    ),
    # In bars 9 to 12 the left hand leaves out the F#4 that the right hand holds.
    "satie-gymnopedie-1": Piece(
        title="E. Satie: Gymnopédie No. 1, opening",
        tempo=76,
        bar=3,
        voices=(
            Voice(
                """
                r*3 | r*3 | r*3 | r*3 |
                r F#5 A5 | G5 F#5 C#5 | B4 C#5 D5 | A4*3 | F#4*12 |
                r F#5 A5 | G5 F#5 C#5 | B4 C#5 D5 | A4*3 |
                """,
                velocity=60,
            ),
            Voice("G2 | D2 | " * 8, unit=3, velocity=48),
            Voice(
                "r*1 B3+D4+F#4 | r*1 A3+C#4+F#4 | " * 4
                + "r*1 B3+D4 | r*1 A3+C#4 | " * 2
                + "r*1 B3+D4+F#4 | r*1 A3+C#4+F#4 | " * 2,
                unit=2,
                velocity=40,
            ),
        ),
        pedal="P | " * 16,
    ),
    "twinkle-twinkle": _twinkle(),
}

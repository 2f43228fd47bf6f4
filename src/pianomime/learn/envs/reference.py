"""What an expert is trained on: a score, and the fingertip plan that it follows."""

from __future__ import annotations

from pathlib import Path

from pianomime.errors import InputError
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.plan import ZeroShotPlanner
from pianomime.plan.demonstration import Demonstration
from pianomime.songs.find import find_song

SHORTEST = 20
"""Frames of the shortest song that anything can be learned on: one second."""


def load_song(
    name: str | Path, start: float = 0.0, seconds: float = EXCERPT_SECONDS
) -> Demonstration:
    """The excerpt of a demonstration, or of a song with the zero-shot plan in a human's place.

    Args:
        name: a demonstration (.npz), a MIDI file, or the name of a bundled song.
        start: where to begin [s].
        seconds: length at most [s].

    Raises:
        InputError: it is neither, or nothing can be learned on it.
    """
    if Path(name).suffix == ".npz":
        shown = Demonstration.load(name).excerpt(start, seconds)
    else:
        score = load_score(name, start, seconds)
        shown = Demonstration(score, ZeroShotPlanner().plan(score), source="zero-shot plan")
    check_song(shown, str(name))
    return shown


def load_score(name: str | Path, start: float, seconds: float) -> Score:
    """The score of what `load_song` would load.

    Raises:
        InputError: there is no such thing.
    """
    if Path(name).suffix == ".npz":
        return Demonstration.load(name).excerpt(start, seconds).score
    return excerpt(Score.from_midi(find_song(str(name))), start, seconds)


def check_song(song: Demonstration, name: str) -> None:
    """Refuse a song on which nothing can be learned.

    Raises:
        InputError: it is shorter than a second, silent, or no finger plays any of it.
    """
    if len(song.plan) < SHORTEST:
        raise InputError(
            f"{name}: lasts {len(song.plan) / 20:.2f} s; a song takes a second at least"
        )
    if not len(song.score):
        raise InputError(f"{name}: has no notes")
    if not (song.plan.finger_key >= 0).any():
        raise InputError(f"{name}: no finger presses a key in it")

"""Advice of a command on doubts about a video: it names options of that command alone."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Advice:
    """What to do about some doubts, in one line each; empty if there is nothing to do.

    Attributes:
        octave: the octave of the keys is open.
        mirror: it is open whether the video is mirrored.
        stretch: the names of keys are not sure from some second on.
        told: the picture contradicts the names of the keys that a user told.
        late: the sound is late; `{offset:.2f}` stands for the --offset that was found [s].
    """

    octave: str
    mirror: str
    stretch: str
    told: str
    late: str


RETARGET = Advice(
    octave="name it with --octave; a MIDI file would decide",
    mirror="tell it with --mirrored or --not-mirrored; a MIDI file would decide",
    stretch="look at the overlay from there; if it is wrong, cut the video there",
    told="look at the pictures on the page; if the picture is right, leave out --points, --octave "
    "and --mirrored, or mend them",
    late="if that is wrong, give another --offset than {offset:.2f}",
)
KEYBOARD = Advice(
    octave="name it with --octave",
    mirror="tell it with --mirrored or --not-mirrored",
    stretch="cut the video there, and look at each part",
    told="if the picture is right, leave out --octave, --mirrored and --not-mirrored, or mend them",
    late="",
)
TRANSCRIBE = Advice(
    octave="name it with --octave of `pianomime transcribe`",
    mirror="tell it with --mirrored or --not-mirrored of `pianomime transcribe`",
    stretch="if the notes are wrong from there on, cut the video there",
    told="look at what `pianomime keyboard` shows; if the picture is right, leave out --octave and "
    "--mirrored, or mend them",
    late="",
)
"""Also of `pianomime play`, which transcribes, and has fewer options."""

"""The notes of a recording: of its sound, of keys that light up in its pictures, or of both."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

from pianomime.errors import InputError
from pianomime.media.opening import open_media, pictures_of
from pianomime.music import Score
from pianomime.progress import Progress, no_progress
from pianomime.transcription.listener import Listener, check_listener
from pianomime.transcription.recording import Recording
from pianomime.transcription.transcribe import transcribe, transcribe_excerpt
from pianomime.video import remarks as remark
from pianomime.video.advice import TRANSCRIBE
from pianomime.video.keyboard.points import NamedPoints, read_points
from pianomime.video.lit_film import LitNotes, notes_of_lit_film, ways_of_lit_film
from pianomime.video.notes.open_names import name_by_sound
from pianomime.video.remarks import Remark


@dataclass(frozen=True)
class RecordingConfig:
    """What is known about a recording, and what of it is wanted."""

    notes: Literal["auto", "sound", "light"] = "auto"
    """What the notes are taken from: the `sound`, or `light`, that is, keys that light up in a
    film. `auto` is both where keys light up and their notes are heard: keys are from light, and
    time, velocity and pedal from sound; else it is what there is of the two."""
    points: Path | None = None
    """JSON file of named points of a film's keyboard; by default it is found automatically."""
    octave: int | None = None
    """Octave of the lowest C that is seen, 4 for the middle C; by default it is found out."""
    mirrored: bool | None = None
    """Whether a film is mirrored; by default it is found out."""
    start: float = 0.0
    """Where what is wanted begins [s]. Of sound without pictures, what comes after it is spared."""
    seconds: float = math.inf
    """How much is wanted from the first note there on [s]."""


class RecordingNotes(NamedTuple):
    """The notes of a recording, with doubts as `remarks`, and what they were taken from."""

    score: Score
    source: Literal["sound", "light", "light and sound"]


def notes_of_recording(
    path: Path,
    config: RecordingConfig | None = None,
    progress: Progress = no_progress,
    listener: Listener | None = None,
) -> RecordingNotes:
    """Read the notes of a file of sound or of a film.

    Args:
        path: the file.
        config: what is known about it.
        progress: called in the phase "listening", and in those of `notes_of_lit_film`.
        listener: who hears the notes of the sound; transkun if not given.

    Raises:
        InputError: the file cannot be used, or has no notes: no piano is heard, or cannot be since
            transkun is not installed, and no keys light up.
    """
    config = config or RecordingConfig()
    if path.is_dir():
        raise InputError(f"{path}: is a folder, not a recording")
    with open_media(path, "sound or a video that can be read") as container:
        film = pictures_of(container) is not None
    if config.notes == "light":
        points = _points(config)
        seen = notes_of_lit_film(path, points, progress, config.octave, config.mirrored)
        return RecordingNotes(seen, "light")
    if config.notes == "sound" or not film:
        return RecordingNotes(_heard(path, config, progress, listener, film), "sound")
    heard: Score | None = None
    why = ""
    try:
        heard = _heard(path, config, progress, listener, film)
    except InputError as error:
        why = _reason(path, error)
    try:
        points = _points(config)
        ways = ways_of_lit_film(path, points, progress, config.octave, config.mirrored)
    except InputError as error:
        if heard is None:
            raise InputError(
                f"{path}: no notes: of its sound: {why}; of its pictures: {_reason(path, error)}"
            ) from error
        return RecordingNotes(heard, "sound")
    if heard is None:
        return _alone(ways[0], remark.on_unused_sound(why))
    return _both(ways, heard)


def _heard(
    path: Path, config: RecordingConfig, progress: Progress, listener: Listener | None, film: bool
) -> Score:
    """The notes of the sound."""
    recording = Recording.of(path)
    if listener is None:
        check_listener()
    if film:
        return transcribe(recording, listener, progress)
    return transcribe_excerpt(recording, config.start, config.seconds, listener, progress)


def _points(config: RecordingConfig) -> NamedPoints | None:
    return None if config.points is None else read_points(config.points)


def _reason(path: Path, error: InputError) -> str:
    """What is said of a file, without its name."""
    return str(error).removeprefix(f"{path}: ")


def _alone(seen: LitNotes, why: list[Remark]) -> RecordingNotes:
    """The notes of keys that light up, where the sound says nothing of them."""
    remarks = (*seen.open_names, *seen.score.remarks, *map(str, why))
    return RecordingNotes(replace(seen.score, remarks=remarks), "light")


def _both(ways: list[LitNotes], heard: Score) -> RecordingNotes:
    """The notes of light and sound where they agree; else those that are less in doubt.

    What the film leaves open of the names of the keys, the sound decides.
    """
    way, fused, decided = name_by_sound([each.score for each in ways], heard)
    said = remark.on_fused(fused, TRANSCRIBE)
    if fused.alike:
        open_names = () if decided else ways[way].open_names
        remarks = (*open_names, *ways[way].score.remarks, *map(str, said))
        return RecordingNotes(replace(fused.score, remarks=remarks), "light and sound")
    if heard.remarks:
        return _alone(ways[0], said)
    # No hands vouch for what lights up, and of the sound there is no doubt.
    seems = (
        f"keys seem to light up as well, but {fused.both} of {len(fused.score)} notes that are "
        "seen are among those that are heard: the notes are those of the sound (`pianomime "
        "transcribe --notes light` takes the others)"
    )
    return RecordingNotes(replace(heard, remarks=(seems,)), "sound")

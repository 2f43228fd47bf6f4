"""The notes of a film whose keys light up, from its pictures alone: hands are not looked for."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.music.score import MAX_SECONDS
from pianomime.progress import Progress, no_progress
from pianomime.shown import title_of
from pianomime.video import remarks as remark
from pianomime.video.advice import TRANSCRIBE
from pianomime.video.film.film import Film
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import nobody
from pianomime.video.keyboard.points import NamedPoints
from pianomime.video.keyboard.views import MOST_FRAMES, View, find_views, view_of_points
from pianomime.video.notes.key_light import ZONES, KeyLight
from pianomime.video.notes.reading import read_notes


class LitNotes(NamedTuple):
    """The notes of keys that light up, in one way to name the keys.

    Attributes:
        score: the notes in the time of the film, all as loud, without pedal; its `remarks` tell
            what is in doubt in all ways alike.
        open_names: remarks on what the film leaves open of the names of the keys.
    """

    score: Score
    open_names: tuple[str, ...]


def notes_of_lit_film(
    video: str | os.PathLike[str],
    points: NamedPoints | None = None,
    progress: Progress = no_progress,
    octave: int | None = None,
    mirrored: bool | None = None,
) -> Score:
    """Read the notes of a film of falling notes, or of another one whose keys light up.

    Where hands are in it as well, `retarget` reads notes better, since these have to agree.

    Args:
        video: a video of a keyboard from above.
        points: named points of the keyboard; by default it is found automatically.
        progress: called in the phases "keyboard", "keys" and "notes".
        octave: of the lowest C that is seen, 4 for the middle C; by default it is found out.
        mirrored: whether the film is; by default it is found out.

    Returns:
        The notes in the time of the film, all as loud, without pedal. If the film leaves the octave
        open, the likeliest one is assumed, and `remarks` says so.

    Raises:
        InputError: it is no video, shows no keyboard, is too long, or its keys do not light up.
    """
    film = _film(video)
    views = _views(film, points, progress, octave, mirrored)
    (likeliest,) = _read(film, views[:1], progress)
    return replace(likeliest.score, remarks=likeliest.open_names + likeliest.score.remarks)


def ways_of_lit_film(
    video: str | os.PathLike[str],
    points: NamedPoints | None = None,
    progress: Progress = no_progress,
    octave: int | None = None,
    mirrored: bool | None = None,
) -> list[LitNotes]:
    """Read the notes of a film whose keys light up in each way to name its keys.

    Args:
        video: as for `notes_of_lit_film`, and so are the others.
        points: named points of the keyboard.
        progress: called in the phases "keyboard", "keys" and "notes".
        octave: of the lowest C that is seen.
        mirrored: whether the film is.

    Returns:
        At least one, the likeliest first.

    Raises:
        InputError: it is no video, shows no keyboard, is too long, or its keys do not light up.
    """
    film = _film(video)
    return _read(film, _views(film, points, progress, octave, mirrored), progress)


def _film(video: str | os.PathLike[str]) -> Film:
    film = Film(video)
    if film.seconds > MAX_SECONDS:
        raise InputError(f"{film.path}: is longer than {MAX_SECONDS / 3600:.0f} hours; cut it")
    return film


def _views(
    film: Film,
    points: NamedPoints | None,
    progress: Progress,
    octave: int | None,
    mirrored: bool | None,
) -> list[View]:
    """The ways to see the keyboard, the likeliest first."""
    if points is not None:
        return [view_of_points(points, film)]
    views = find_views(film, MOST_FRAMES, octave, mirrored, progress)
    if not views:
        raise InputError(remark.no_keyboard(film.path, remark.told_names(octave, mirrored)))
    return views


def _read(film: Film, views: list[View], progress: Progress) -> list[LitNotes]:
    """The notes in each view in which keys light up."""
    readers = [KeyLight(view.track, film.working_size) for view in views]
    total = round(film.seconds * FRAME_RATE)
    ways = []
    surest = 0.0
    with ExitStack() as records:
        lights = [records.enter_context(LightRecord(len(ZONES))) for _ in views]
        for number, frame in enumerate(islice(film.frames(FRAME_RATE), MOST_FRAMES)):
            for reader, light in zip(readers, lights, strict=True):
                light.append(reader.read(number, frame.picture))
            progress("keys", number + 1, max(total, number + 1))
        progress("notes", 0, 0)
        for view, light in zip(views, lights, strict=True):
            frames = len(light)
            missing = view.track.missing(frames)
            read = read_notes(light, nobody(frames), missing, title_of(film.path))
            if read.lit:
                ways.append(_notes(view, read.score, missing))
            else:
                surest = max(surest, read.confidence)
    if not ways:
        raise InputError(
            f"{film.path}: keys do not light up in this film (confidence {surest:.0%}), so it does "
            "not show what is played"
        )
    return ways


def _notes(view: View, score: Score, missing: NDArray[np.bool_]) -> LitNotes:
    """The notes in a view, with remarks."""
    told = [
        *remark.on_stretches(view, TRANSCRIBE),
        *remark.on_unseen_keyboard(missing),
    ]
    if view.namings:
        told += remark.on_told_names(view.namings[0].plane, view.untold, TRANSCRIBE)
    open_names = remark.on_naming(view.namings, TRANSCRIBE)
    return LitNotes(replace(score, remarks=tuple(map(str, told))), tuple(map(str, open_names)))

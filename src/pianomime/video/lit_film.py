"""The notes of a film whose keys light up, from its pictures alone: hands are not looked for."""

from __future__ import annotations

import os
from dataclasses import replace
from itertools import islice

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.music.score import MAX_SECONDS
from pianomime.progress import Progress, no_progress
from pianomime.shown import title_of
from pianomime.video import remarks as remark
from pianomime.video.film.film import Film
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import nobody
from pianomime.video.keyboard.points import NamedPoints
from pianomime.video.keyboard.views import MOST_FRAMES, find_views, view_of_points
from pianomime.video.notes.key_light import ZONES, KeyLight
from pianomime.video.notes.reading import read_notes


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
    film = Film(video)
    if film.seconds > MAX_SECONDS:
        raise InputError(f"{film.path}: is longer than {MAX_SECONDS / 3600:.0f} hours; cut it")
    if points is None:
        views = find_views(film, MOST_FRAMES, octave, mirrored, progress)
        if not views:
            raise InputError(remark.no_keyboard(film.path, remark.told_names(octave, mirrored)))
        view = views[0]
    else:
        view = view_of_points(points, film)
    reader = KeyLight(view.track, film.working_size)
    total = round(film.seconds * FRAME_RATE)
    with LightRecord(len(ZONES)) as light:
        for number, frame in enumerate(islice(film.frames(FRAME_RATE), MOST_FRAMES)):
            light.append(reader.read(number, frame.picture))
            progress("keys", number + 1, max(total, number + 1))
        progress("notes", 0, 0)
        frames = len(light)
        read = read_notes(light, nobody(len(light)), title_of(film.path))
    if not read.lit:
        raise InputError(
            f"{film.path}: keys do not light up in this film (confidence {read.confidence:.0%}), "
            "so it does not show what is played"
        )
    told = [
        *remark.on_naming(view.namings),
        *remark.on_stretches(view),
        *remark.on_unseen_keyboard(view.track.missing(frames)),
    ]
    return replace(read.score, remarks=tuple(map(str, told)))

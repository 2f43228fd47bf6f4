"""From a video to a Demonstration: keyboard, hands, notes, fingers, fingertips."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.music.score import MAX_SECONDS
from pianomime.plan import LEFT, RIGHT
from pianomime.plan.demonstration import Demonstration, on_grid
from pianomime.progress import Progress, no_progress
from pianomime.shown import shown, title_of
from pianomime.video import remarks as remark
from pianomime.video.align import Rule, align, raised
from pianomime.video.film.background import background
from pianomime.video.film.film import Film
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.detector import HandDetector, check_mediapipe
from pianomime.video.hands.model import find_hand_model
from pianomime.video.hands.sightings import Sightings
from pianomime.video.hands.tracks import HandTracks, follow
from pianomime.video.keyboard.keyboard import Keyboard, find_keyboards
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.points import NamedPoints, read_points
from pianomime.video.notes.fingers import NoteFingers, find_note_fingers
from pianomime.video.notes.key_light import ZONES, KeyLight
from pianomime.video.notes.offset import Offset, estimate_offset
from pianomime.video.notes.reading import read_notes
from pianomime.video.parallax import correct_parallax

_MOST_FRAMES = int(MAX_SECONDS * FRAME_RATE) - 1
"""Frames of the longest score; a video may be longer than its header says."""
_TOO_FEW_TOUCHED = 0.5
"""Share of a MIDI file's notes with a finger on their key below which it is of another song."""
_FEW_TOUCHED = 0.7
"""Share of notes with a finger on their key below which notes read from a video are doubtful."""
_BETTER = 0.02
"""Share of notes by which a less likely octave must have more fingers on keys to be chosen."""


@dataclass(frozen=True)
class RetargetConfig:
    """What is known about a video, and how to make a demonstration of it."""

    midi: Path | None = None
    """MIDI file of what is played; by default the notes are read from the video."""
    points: Path | None = None
    """JSON file of named points of the keyboard; by default the keyboard is found automatically."""
    offset: float | None = None
    """Time in the video at which the MIDI file begins [s]; by default it is estimated."""
    hand_model: Path | None = None
    """MediaPipe's hand_landmarker.task; by default it is downloaded once."""
    align: Rule = "steady"
    """How fingertips are moved onto the keys they press, see `align`."""


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A demonstration, and what pictures of its making need.

    Attributes:
        demonstration: the result.
        film: the video.
        plane: plane of the keyboard in its pictures.
        tracks: the tracked hands.
        fingers: the finger that plays each note.
        remarks: what a user should know, one line each.
    """

    demonstration: Demonstration
    film: Film
    plane: Plane
    tracks: HandTracks
    fingers: NoteFingers
    remarks: list[str]


def retarget(
    video: Path, config: RetargetConfig | None = None, progress: Progress = no_progress
) -> Retargeted:
    """Make a demonstration of a video.

    Args:
        video: a video of a keyboard from above.
        config: what else is known.
        progress: called in the phases "keyboard", "hands" and "notes".

    Raises:
        InputError: a file cannot be used, or the video shows no keyboard or no hands.
    """
    config = config or RetargetConfig()
    given = _Given.read(video, config)
    progress("keyboard", 0, 0)
    views = _find_views(given)
    seen = _watch(given, views, progress)
    timed = seen.timed
    # Worked on in place: these become the plan.
    fingertips = raised(seen.tracks.points, timed.score.frames())
    fingers = find_note_fingers(timed.score, fingertips, seen.tracks.seen)
    parallax = correct_parallax(fingertips, timed.score, fingers)
    fingers = find_note_fingers(timed.score, fingertips, seen.tracks.seen)
    plan = align(timed.score, fingertips, fingers, config.align)
    remarks = [
        *seen.remarks,
        *timed.remarks,
        *remark.on_fingering(fingers, plan),
        *remark.on_lost_hands(seen.tracks),
    ]
    quality: dict[str, Any] = {
        "keyboard": seen.view.description,
        **_quality_of_hands(seen.tracks),
        "notes": len(timed.score),
        "notes_guessed": int(fingers.guessed.sum()),
        "parallax_millimetres": round(parallax, 2),
        "align": config.align,
        **timed.facts,
        "remarks": remarks,
    }
    homography = seen.view.plane.zoomed(given.film.zoom).matrix
    demonstration = Demonstration(timed.score, plan, shown(video.name), homography, quality)
    return Retargeted(demonstration, given.film, seen.view.plane, seen.tracks, fingers, remarks)


@dataclass(frozen=True, eq=False)
class _Given:
    """The files that a user gave, read and checked."""

    config: RetargetConfig
    film: Film
    score: Score | None
    points: NamedPoints | None
    hand_model: Path

    @staticmethod
    def read(video: Path, config: RetargetConfig) -> _Given:
        """Everything that can be wrong with the files is found here, before the long work."""
        if config.offset is not None and not abs(config.offset) <= MAX_SECONDS:
            raise InputError(f"--offset must be a time in the video, not {config.offset:g} s")
        # Before anything is read, and long before the hand model is downloaded for it.
        check_mediapipe()
        points = None if config.points is None else read_points(config.points)
        score = None if config.midi is None else Score.from_midi(config.midi)
        film = Film(video)
        if film.seconds > MAX_SECONDS:
            raise InputError(f"{video}: is longer than {MAX_SECONDS / 3600:.0f} hours; cut it")
        return _Given(config, film, score, points, find_hand_model(config.hand_model))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the pictures as they are read [pixels]."""
        return (
            round(self.film.width / self.film.zoom),
            round(self.film.height / self.film.zoom),
        )


@dataclass(frozen=True, eq=False)
class _View:
    """A way to see the keyboard in the video: its plane, and a line for the user.

    Attributes:
        plane: from pixels of the pictures as they are read to the world.
        description: one line.
        only_guess: the keyboard, where its octave is open and no MIDI file decides.
    """

    plane: Plane
    description: str
    only_guess: Keyboard | None = None


@dataclass(frozen=True, eq=False)
class _Timed:
    """The score in the time of the video, facts for `Demonstration.quality`, and remarks."""

    score: Score
    facts: dict[str, Any]
    remarks: list[str]


@dataclass(frozen=True, eq=False)
class _Seen:
    """What one pass over the video showed, in the best view."""

    view: _View
    tracks: HandTracks
    timed: _Timed
    remarks: list[str]


def _find_views(given: _Given) -> list[_View]:
    """The ways to see the keyboard, the likeliest first: one, or one for each possible octave."""
    film = given.film
    if given.points is not None:
        return [_View(given.points.plane.zoomed(1 / film.zoom), given.points.describe())]
    keyboards = find_keyboards(background(film))
    if not keyboards:
        raise InputError(
            f"{film.path}: no keyboard found; mark where it is with `pianomime pick {film.path}`"
        )
    if given.score is None:
        # Only notes can decide the octave, so the likeliest one is assumed.
        open_octave = len(keyboards) > 1
        likeliest = keyboards[0]
        return [_View(likeliest.plane, likeliest.describe(), likeliest if open_octave else None)]
    return [_View(keyboard.plane, keyboard.describe()) for keyboard in keyboards]


def _watch(given: _Given, views: list[_View], progress: Progress) -> _Seen:
    """Read the video once: hands, keys, and from these the best view and the score."""
    with ExitStack() as records:
        lights = [records.enter_context(LightRecord(len(ZONES))) for _ in views]
        sightings = _detect(given, views, lights, progress)
        progress("notes", 0, 0)
        best, tracks, offset = _best_view(given, views, sightings, lights)
        del sightings  # in hours of video, they take much memory
        view, light = views[best], lights[best]
        if not tracks.seen.any():
            raise InputError(f"{given.film.path}: no hands are seen playing")
        remarks = [] if view.only_guess is None else [remark.on_octave(view.only_guess)]
        remarks += [*remark.on_missing_hands(tracks), *remark.on_keyboard(light)]
        if len(tracks) == _MOST_FRAMES:
            remarks.append(f"what comes after {MAX_SECONDS / 3600:.0f} hours is left out")
        if given.score is None or offset is None:
            timed = _read_score(given.film, tracks, light)
        else:
            timed = _place_midi(given, given.score, offset, len(tracks) / FRAME_RATE)
    return _Seen(view, tracks, timed, remarks)


def _detect(
    given: _Given, views: list[_View], lights: list[LightRecord], progress: Progress
) -> Sightings:
    """Detect the hands in each frame and record the light of the keys, in one pass."""
    film = given.film
    readers = [KeyLight(view.plane, given.size) for view in views]
    sightings = Sightings()
    total = round(film.seconds * FRAME_RATE)
    with HandDetector(given.hand_model) as detector:
        for number, frame in enumerate(islice(film.frames(FRAME_RATE), _MOST_FRAMES)):
            sightings.append(detector.detect(frame.picture, round(number * 1000 / FRAME_RATE)))
            for reader, light in zip(readers, lights, strict=True):
                light.append(reader.read(frame.picture))
            progress("hands", number + 1, max(total, number + 1))
    return sightings


def _best_view(
    given: _Given, views: list[_View], sightings: Sightings, lights: list[LightRecord]
) -> tuple[int, HandTracks, Offset | None]:
    """The view in which most notes of the MIDI file, if there is one, have a finger on them."""
    best: tuple[int, HandTracks, Offset | None] | None = None
    for number, (view, light) in enumerate(zip(views, lights, strict=True)):
        tracks = follow(sightings, given.size, view.plane)
        if given.score is None:
            return number, tracks, None
        offset = estimate_offset(given.score, tracks, light, given.config.offset)
        if best is None or best[2] is None or offset.touched > best[2].touched + _BETTER:
            best = number, tracks, offset
    assert best is not None
    return best


def _read_score(film: Film, tracks: HandTracks, light: LightRecord) -> _Timed:
    """The score read from the video itself."""
    read = read_notes(light, tracks, title_of(film.path))
    if not read.lit:
        raise InputError(
            f"{film.path}: keys do not light up in this film (confidence {read.confidence:.0%}), "
            "so it does not show what is played: give that with --midi FILE, which may also be "
            "transcribed from the film's sound (with --notes sound, where `pianomime retarget "
            "--help` lists it)"
        )
    remarks = []
    if read.touched < _FEW_TOUCHED:
        remarks.append(
            f"the notes are read from the video and doubtful: {read.touched:.0%} have a finger on "
            "their key"
        )
    facts = {
        "notes_from": "video, from keys that light up",
        "keys_lit_confidence": round(read.confidence, 4),
        "notes_touched": round(read.touched, 4),
    }
    return _Timed(on_grid(read.score), facts, remarks)


def _place_midi(given: _Given, score: Score, offset: Offset, seconds: float) -> _Timed:
    """The MIDI file's score in the time of a video of `seconds`."""
    midi, film = given.config.midi, given.film.path
    if given.config.offset is None and offset.touched < _TOO_FEW_TOUCHED:
        raise InputError(
            f"{midi} is not what is played in {film}: at best {offset.touched:.0%} of its notes "
            "have a finger on their key (give --offset to go on anyway)"
        )
    remarks = remark.on_midi(str(midi), score, offset, seconds)
    begin, end = -offset.seconds, seconds - offset.seconds
    if end <= score.onset[0] or begin >= score.duration:
        raise InputError(f"{midi}: no note falls within {film} at this offset")
    if begin > 0:
        timed = score.clip(begin, end)
    else:
        cut = score.clip(0.0, end)
        timed = replace(
            cut, onset=cut.onset - begin, offset=cut.offset - begin, pedal=cut.pedal - begin
        )
    facts = {
        "notes_from": "" if midi is None else shown(midi.name),
        "offset_seconds": round(offset.seconds, 4),
        "notes_touched": round(offset.touched, 4),
        "notes_touched_by_chance": round(offset.by_chance, 4),
    }
    return _Timed(on_grid(timed), facts, remarks)


def _quality_of_hands(tracks: HandTracks) -> dict[str, Any]:
    """How well the hands were seen, for `Demonstration.quality`."""
    return {
        "seconds": len(tracks) / FRAME_RATE,
        "both_hands_found": round(float(tracks.found.all(axis=1).mean()), 4),
        "left_hand_found": round(float(tracks.found[:, LEFT].mean()), 4),
        "right_hand_found": round(float(tracks.found[:, RIGHT].mean()), 4),
        "points_mended": round(float(tracks.mended.mean()), 4),
        "ghost_hands": tracks.ghosts,
        "left_right_swaps": tracks.swaps,
    }

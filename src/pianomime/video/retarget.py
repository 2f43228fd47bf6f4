"""From a video to a Demonstration: keyboard, hands, notes, fingers, fingertips."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE, key_name
from pianomime.music import Score
from pianomime.music.score import MAX_SECONDS
from pianomime.plan import LEFT, RIGHT
from pianomime.plan.demonstration import Demonstration, on_grid
from pianomime.progress import Progress, no_progress
from pianomime.video.align import Rule, align, raised
from pianomime.video.film.film import Film
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.detector import HandDetector
from pianomime.video.hands.model import find_hand_model
from pianomime.video.hands.sightings import Sightings
from pianomime.video.hands.tracks import HandTracks, follow, poorly_seen
from pianomime.video.keyboard.keyboard import find_keyboards
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.points import read_points
from pianomime.video.notes.fingers import NoteFingers, find_note_fingers
from pianomime.video.notes.key_light import ZONES, KeyLight
from pianomime.video.notes.offset import Offset, estimate_offset
from pianomime.video.notes.reading import read_notes
from pianomime.video.parallax import take_back_parallax
from pianomime.video.stretches import stretches

_BACKGROUND_FRAMES = 25
_MOST_FRAMES = int(MAX_SECONDS * FRAME_RATE) - 1
"""That a score can be as long as; files need not say how long they are."""
_TOO_FEW_TOUCHED = 0.5
"""Share of a MIDI file's notes with a finger on their key below which it is of another song."""
_FEW_TOUCHED = 0.7
"""Share of notes with a finger on their key below which notes read off a video are doubtful."""


@dataclass(frozen=True)
class RetargetConfig:
    """How to make a demonstration of a video."""

    midi: Path | None = None
    """What is played; read off the video if not given."""
    points: Path | None = None
    """JSON of named points of the keyboard; found by itself if not given."""
    offset: float | None = None
    """When in the video the MIDI file begins [s]; estimated if not given."""
    hand_model: Path | None = None
    """MediaPipe's hand_landmarker.task; downloaded once if not given."""
    align: Rule = "steady"
    """How fingertips are put on keys."""


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A demonstration, and what a picture of how it was made needs.

    Attributes:
        demonstration: the result.
        film: the video.
        plane: from its pixels to the world.
        tracks: the hands, as they were seen and repaired.
        fingers: who played each note.
        remarks: what a person should know, one line each.
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
        video: any video of a keyboard from above.
        config: what else is known.
        progress: told the phase, and the frames done and in all.

    Raises:
        InputError: a file is not what it should be, or the video shows no keyboard, or no hands.
    """
    config = config or RetargetConfig()
    # What can be wrong is looked at before what takes long.
    if config.offset is not None and not abs(config.offset) <= MAX_SECONDS:
        raise InputError(f"--offset must be a time in the video, not {config.offset:g} s")
    named = None if config.points is None else read_points(config.points)
    score = None if config.midi is None else Score.from_midi(config.midi)
    film = Film(video)
    if film.seconds > MAX_SECONDS:
        raise InputError(f"{video}: is longer than {MAX_SECONDS / 3600:.0f} hours; cut it")
    model = find_hand_model(config.hand_model)
    remarks: list[str] = []
    progress("keyboard", 0, 0)
    background = _background(film)
    if named is None:
        ways = find_keyboards(background)
        if not ways:
            raise InputError(
                f"{video}: no keyboard found; show where it is with `pianomime pick {video}`"
            )
        seen = ways[0].describe()
        # Which octave it is only the notes can tell, and each way takes memory.
        planes = [way.plane for way in (ways if score is not None else ways[:1])]
    else:
        seen = named.describe()
        planes = [named.plane.zoomed(1 / film.zoom)]
        ways = []
    size = (round(film.width / film.zoom), round(film.height / film.zoom))
    with ExitStack() as records:
        lights = [records.enter_context(LightRecord(len(ZONES))) for _ in planes]
        readers = [KeyLight(plane, size) for plane in planes]
        sightings = _watch(film, readers, lights, model, progress)
        progress("notes", 0, 0)
        best, tracks, offset = _best_way(sightings, size, planes, lights, score, config.offset)
        del sightings  # what is no longer needed goes: hours of it take much memory
        plane, light = planes[best], lights[best]
        if ways:
            seen = ways[best].describe()
            if len(ways) > 1 and offset is None:
                lowest = key_name(int(np.flatnonzero(ways[best].seen)[0]))
                remarks.append(
                    f"the video does not tell the octave: the lowest key seen is taken for {lowest}"
                    " (a MIDI file would tell)"
                )
        _check_hands(video, tracks, remarks)
        remarks += _hidden(light)
        if len(tracks) == _MOST_FRAMES:
            remarks.append(f"what comes after {MAX_SECONDS / 3600:.0f} hours is left out")
        score, facts = _score(film, score, offset, tracks, light, config, remarks)
    # These become the plan, and are worked on in place.
    fingertips = raised(tracks.points, score.frames())
    fingers = find_note_fingers(score, fingertips, tracks.seen)
    parallax = take_back_parallax(fingertips, score, fingers)
    fingers = find_note_fingers(score, fingertips, tracks.seen)
    plan = align(score, fingertips, fingers, config.align)
    if fingers.guessed.any():
        remarks.append(
            f"{int(fingers.guessed.sum())} of {len(score)} notes have no finger near their key: "
            "theirs is a guess"
        )
    if plan.dropped:
        remarks.append(f"{plan.dropped} of {len(score)} notes are played by no finger")
    for first, end, hand in poorly_seen(tracks):
        which = "left" if hand == LEFT else "right"
        remarks.append(f"the {which} hand is not seen from {first:.1f} s to {end:.1f} s")
    found = tracks.found
    quality: dict[str, Any] = {
        "keyboard": seen,
        "seconds": len(tracks) / FRAME_RATE,
        "both_hands_found": round(float(found.all(axis=1).mean()), 4),
        "left_hand_found": round(float(found[:, 0].mean()), 4),
        "right_hand_found": round(float(found[:, 1].mean()), 4),
        "points_mended": round(float(tracks.mended.mean()), 4),
        "ghost_hands": tracks.ghosts,
        "left_right_swaps": tracks.swaps,
        "notes": len(score),
        "notes_guessed": int(fingers.guessed.sum()),
        "parallax_millimetres": round(parallax, 2),
        "align": config.align,
        **facts,
        "remarks": remarks,
    }
    demonstration = Demonstration(score, plan, video.name, plane.zoomed(film.zoom).matrix, quality)
    return Retargeted(demonstration, film, plane, tracks, fingers, remarks)


def _background(film: Film) -> NDArray[np.float32]:
    """The grey picture (height, width), 0..1, that stays when hands and lights come and go."""
    pictures = film.sample(_BACKGROUND_FRAMES)
    if not pictures:
        raise InputError(f"{film.path}: no picture in it can be read")
    # Row by row: all of them at once, in grey, take several times their memory.
    rows = [
        np.median([picture[row].mean(axis=1, dtype=np.float32) for picture in pictures], axis=0)
        for row in range(len(pictures[0]))
    ]
    return np.asarray(np.stack(rows) / 255, np.float32)


def _watch(
    film: Film, readers: list[KeyLight], lights: list[LightRecord], model: Path, progress: Progress
) -> Sightings:
    """In one pass over the film find the hands in each frame, and fill the records."""
    sightings = Sightings()
    total = round(film.seconds * FRAME_RATE)
    with HandDetector(model) as detector:
        for number, frame in enumerate(islice(film.frames(FRAME_RATE), _MOST_FRAMES)):
            sightings.append(detector.detect(frame.picture, round(number * 1000 / FRAME_RATE)))
            for reader, light in zip(readers, lights, strict=True):
                light.append(reader.read(frame.picture))
            progress("hands", number + 1, max(total, number + 1))
    return sightings


def _best_way(
    sightings: Sightings,
    size: tuple[int, int],
    planes: list[Plane],
    lights: list[LightRecord],
    score: Score | None,
    given: float | None,
) -> tuple[int, HandTracks, Offset | None]:
    """The plane under which the notes of the score, if there is one, are most under fingers."""
    best: tuple[int, HandTracks, Offset | None] | None = None
    for number, (plane, light) in enumerate(zip(planes, lights, strict=True)):
        tracks = follow(sightings, size, plane)
        if score is None:
            return number, tracks, None
        offset = estimate_offset(score, tracks, light, given)
        if best is None or best[2] is None or offset.touched > best[2].touched + 0.02:
            best = number, tracks, offset
    assert best is not None
    return best


def _check_hands(video: Path, tracks: HandTracks, remarks: list[str]) -> None:
    if not tracks.seen.any():
        raise InputError(f"{video}: no hands are seen playing")
    for hand, name in ((LEFT, "left"), (RIGHT, "right")):
        if not tracks.seen[hand]:
            remarks.append(f"only one hand is seen: the {name} one is made up, at rest")


def _hidden(light: LightRecord) -> list[str]:
    """Remarks on when the keyboard does not look like itself: after a cut, or a move."""
    far_end = list(ZONES).index("far end")
    usual = np.median(light.every(max(1, len(light) // 2000), far_end).mean(axis=2), axis=0)
    usual = usual - usual.mean()
    if not usual.any():
        return []  # none of it is within the picture
    likeness = []
    for block in light.blocks(far_end):
        level = block.mean(axis=2)
        level = level - level.mean(axis=1, keepdims=True)
        scale = np.linalg.norm(level, axis=1) * np.linalg.norm(usual) + 1e-9
        likeness.append(level @ usual / scale)
    return [
        f"the keyboard is not where it was, or hidden, from {first:.1f} s to {end:.1f} s"
        for first, end in stretches(np.concatenate(likeness) < 0.5)
    ]


def _score(
    film: Film,
    score: Score | None,
    offset: Offset | None,
    tracks: HandTracks,
    light: LightRecord,
    config: RetargetConfig,
    remarks: list[str],
) -> tuple[Score, dict[str, Any]]:
    """What is played, timed by the video, and figures about it."""
    seconds = len(tracks) / FRAME_RATE
    if score is None or offset is None:
        read = read_notes(light, tracks, film.path.stem)
        if not len(read.score):
            raise InputError(
                f"{film.path}: no keys are seen going down or lighting up; name what is played "
                "with --midi"
            )
        if not read.lit:
            remarks.append(
                "no keys light up: the notes are read off keys that change their shade when they "
                "go down, and many are missed (a MIDI file would tell)"
            )
        if read.touched < _FEW_TOUCHED:
            remarks.append(
                f"the notes are read off the video and doubtful: {read.touched:.0%} have a finger "
                "on their key"
            )
        return on_grid(read.score), {
            "notes_from": "video, from keys that " + ("light up" if read.lit else "go down"),
            "notes_touched": round(read.touched, 4),
        }
    if config.offset is None and offset.touched < _TOO_FEW_TOUCHED:
        raise InputError(
            f"{config.midi} is not what is played in {film.path}: at best {offset.touched:.0%} of "
            "its notes have a finger on their key (--offset makes me go on all the same)"
        )
    if not offset.matches:
        remarks.append(
            f"{config.midi} may not be what is played: {offset.touched:.0%} of its notes have a "
            f"finger on their key, {offset.by_chance:.0%} would by chance"
        )
    begin, end = -offset.seconds, seconds - offset.seconds
    if end <= score.onset[0] or begin >= score.duration:
        raise InputError(f"{config.midi}: no note falls within {film.path} at this offset")
    early = int((score.onset < begin - 0.1).sum())
    late = int((score.onset >= end).sum())
    if early:
        remarks.append(f"{early} notes of the MIDI file come before the video begins")
    if late:
        remarks.append(f"{late} notes of the MIDI file come after the video ends")
    if seconds > score.duration + offset.seconds + 2:
        remarks.append(
            f"the video goes on for {seconds - score.duration - offset.seconds:.1f} s after the "
            "MIDI file's last note"
        )
    if begin > 0:
        timed = score.clip(begin, end)
    else:
        cut = score.clip(0.0, end)
        timed = replace(
            cut, onset=cut.onset - begin, offset=cut.offset - begin, pedal=cut.pedal - begin
        )
    return on_grid(timed), {
        "notes_from": "" if config.midi is None else config.midi.name,
        "offset_seconds": round(offset.seconds, 4),
        "notes_touched": round(offset.touched, 4),
        "notes_touched_by_chance": round(offset.by_chance, 4),
    }

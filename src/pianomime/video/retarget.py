"""From a video to a Demonstration: keyboard, hands, notes, fingers, fingertips."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.installation import install_command
from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.music.score import MAX_SECONDS
from pianomime.plan.demonstration import Demonstration, on_grid
from pianomime.progress import Progress, no_progress
from pianomime.shown import shown, title_of
from pianomime.transcription.listener import Listener, can_listen, check_listener
from pianomime.transcription.recording import Recording
from pianomime.transcription.transcribe import transcribe
from pianomime.video import remarks as remark
from pianomime.video.advice import RETARGET
from pianomime.video.align import Rule, align, raised
from pianomime.video.confidence import Confidence, estimate_confidence
from pianomime.video.film.background import background
from pianomime.video.film.film import Film
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.detector import HandDetector, check_mediapipe
from pianomime.video.hands.model import find_hand_model
from pianomime.video.hands.sightings import Sightings
from pianomime.video.hands.tracks import HandTracks, follow
from pianomime.video.keyboard.keyboard import find_keyboards
from pianomime.video.keyboard.points import NamedPoints, read_points
from pianomime.video.keyboard.track import KeyboardTrack
from pianomime.video.keyboard.views import MOST_FRAMES, View, find_views, view_of_points
from pianomime.video.keyboard_look import KeyboardLook, look_at_keyboard
from pianomime.video.notes.fingers import NoteFingers, find_note_fingers
from pianomime.video.notes.heard import check_heard
from pianomime.video.notes.key_light import ZONES, KeyLight
from pianomime.video.notes.offset import LATE_SOUND, LATEST_SOUND, Offset, estimate_offset
from pianomime.video.notes.open_names import name_by_sound
from pianomime.video.notes.reading import ReadNotes, read_notes
from pianomime.video.parallax import correct_parallax
from pianomime.video.remarks import Remark
from pianomime.video.repairs import Repair, list_repairs
from pianomime.video.verdict import Verdict, judge

_TOO_FEW_TOUCHED = 0.5
"""Share of a MIDI file's notes with a finger on their key below which it is of another song."""
_BETTER = 0.02
"""Share of notes by which a less likely octave must have more fingers on keys to be chosen."""


@dataclass(frozen=True)
class RetargetConfig:
    """What is known about a video, and how to make a demonstration of it."""

    midi: Path | None = None
    """MIDI file of what is played; by default the notes are taken from the video."""
    points: Path | None = None
    """JSON file of named points of the keyboard; by default the keyboard is found automatically."""
    octave: int | None = None
    """Octave of the lowest C that is seen, 4 for the middle C; by default it is found out."""
    mirrored: bool | None = None
    """Whether the video is mirrored; by default it is found out."""
    offset: float | None = None
    """Time in the video at which the MIDI file begins, or by which its own sound is early [s]; by
    default it is estimated."""
    hand_model: Path | None = None
    """MediaPipe's hand_landmarker.task; by default it is downloaded once."""
    align: Rule = "steady"
    """How fingertips are moved onto the keys they press, see `align`."""
    notes: Literal["auto", "midi", "light", "sound"] = "auto"
    """What the notes are taken from: `midi`; `light`, that is, keys that light up; or the `sound`
    of the video. `auto` is the MIDI file if there is one, else light where keys light up, else
    sound where the extra `audio` is installed and a piano is heard. Where there are both light and
    sound, `auto` takes keys from light and time, velocity and pedal from sound."""


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A demonstration, and what pictures of its making need.

    Attributes:
        demonstration: the result.
        film: the video.
        track: of the keyboard in its pictures.
        tracks: the tracked hands.
        fingers: the finger that plays each note.
        confidence: in each frame.
        repairs: what was repaired, and how often.
        remarks: what a user should know, and do.
        verdict: whether to use it.
    """

    demonstration: Demonstration
    film: Film
    track: KeyboardTrack
    tracks: HandTracks
    fingers: NoteFingers
    confidence: Confidence
    repairs: list[Repair]
    remarks: list[Remark]
    verdict: Verdict


def retarget(
    video: Path,
    config: RetargetConfig | None = None,
    progress: Progress = no_progress,
    listener: Listener | None = None,
) -> Retargeted:
    """Make a demonstration of a video.

    Args:
        video: a video of a keyboard from above.
        config: what else is known.
        progress: called in the phases "keyboard", "hands" and "notes", and "listening" where the
            notes are taken from sound.
        listener: who hears the notes; transkun if not given.

    Raises:
        InputError: a file cannot be used, or the video shows no keyboard or no hands.
    """
    config = config or RetargetConfig()
    given = _Given.read(video, config, listener)
    if config.notes == "sound":
        given = replace(given, score=given.heard(progress))
    views = _find_views(given, progress)
    seen = _watch(given, views, progress)
    timed = seen.timed
    # Worked on in place: these become the plan.
    fingertips = raised(seen.tracks.points, timed.score.frames())
    fingers = find_note_fingers(timed.score, fingertips, seen.tracks.seen)
    parallax = correct_parallax(fingertips, timed.score, fingers)
    fingers = find_note_fingers(timed.score, fingertips, seen.tracks.seen)
    confidence = estimate_confidence(
        seen.tracks,
        timed.score,
        fingers,
        fingertips[: len(seen.tracks), ..., :2].astype(np.float32),
        seen.look,
        seen.missing,
        timed.certainty,
    )
    plan = align(timed.score, fingertips, fingers, config.align)
    agreed, facts = confidence.agreement, timed.facts
    remarks = [
        *remark.on_agreement(confidence, facts["notes_from"], facts.get("offset_seconds")),
        *seen.remarks,
        *timed.remarks,
        *remark.on_fingering(confidence, plan),
        *remark.on_lost_hands(seen.tracks, seen.missing),
    ]
    verdict = judge(confidence, remarks)
    repairs = list_repairs(seen.tracks, plan, confidence, timed.outside)
    quality: dict[str, Any] = {
        "verdict": verdict.grade,
        "confidence": round(confidence.mean, 4),
        "seconds": len(seen.tracks) / FRAME_RATE,
        "seconds_with_keyboard": int((~seen.missing).sum()) / FRAME_RATE,
        "seconds_in_doubt": int(confidence.in_doubt.sum()) / FRAME_RATE,
        "keyboard": seen.view.description,
        "black_and_white_agree": None if seen.look.pattern is None else round(seen.look.pattern, 4),
        "notes": len(timed.score),
        **facts,
        "notes_touched": round(agreed.share, 4),
        "notes_touched_by_chance": round(agreed.chance, 4),
        "parallax_millimetres": round(parallax, 2),
        "align": config.align,
        "repaired": {repair.name: repair.count for repair in repairs},
        "remarks": [str(each) for each in remarks],
        "confidence_by_second": [round(float(each), 2) for each in confidence.by_second()],
    }
    homography = seen.view.track.usual.zoomed(given.film.zoom).matrix
    demonstration = Demonstration(timed.score, plan, shown(video.name), homography, quality)
    return Retargeted(
        demonstration,
        given.film,
        seen.view.track,
        seen.tracks,
        fingers,
        confidence,
        repairs,
        remarks,
        verdict,
    )


@dataclass(frozen=True, eq=False)
class _Given:
    """The files that a user gave, read and checked.

    Attributes:
        config: what is known about the video.
        film: the video.
        score: the notes, of a MIDI file or of the sound; None if they are read from keys.
        recording: the sound of the video, where the notes may be taken from it.
        points: of the keyboard.
        hand_model: MediaPipe's.
        listener: who hears the notes of the sound; transkun if None.
    """

    config: RetargetConfig
    film: Film
    score: Score | None
    recording: Recording | None
    points: NamedPoints | None
    hand_model: Path
    listener: Listener | None

    @staticmethod
    def read(video: Path, config: RetargetConfig, listener: Listener | None) -> _Given:
        """Everything that can be wrong with the files is found here, before the long work."""
        if config.offset is not None and not abs(config.offset) <= MAX_SECONDS:
            raise InputError(f"--offset must be a time in the video, not {config.offset:g} s")
        if (config.midi is not None) != (config.notes == "midi") and config.notes != "auto":
            missing = "needs --midi" if config.notes == "midi" else "goes without --midi"
            raise InputError(f"--notes {config.notes} {missing}")
        # Before anything is read, and long before the hand model is downloaded for it.
        check_mediapipe()
        if config.notes == "sound" and listener is None:
            check_listener()
        points = None if config.points is None else read_points(config.points)
        score = None if config.midi is None else Score.from_midi(config.midi)
        film = Film(video)
        if film.seconds > MAX_SECONDS:
            raise InputError(f"{video}: is longer than {MAX_SECONDS / 3600:.0f} hours; cut it")
        recording = _recording(video, config) if score is None else None
        model = find_hand_model(config.hand_model)
        return _Given(config, film, score, recording, points, model, listener)

    @property
    def may_listen(self) -> bool:
        """Whether there is a sound to take the notes from, and somebody who hears them."""
        return self.recording is not None and (self.listener is not None or can_listen())

    def heard(self, progress: Progress) -> Score:
        """The notes that are heard in the video, in the time of its pictures.

        Raises:
            InputError: no notes are heard.
        """
        assert self.recording is not None
        return transcribe(self.recording, self.listener, progress)


def _recording(video: Path, config: RetargetConfig) -> Recording | None:
    """The sound of the video, where it is wanted.

    Raises:
        InputError: there is none, and nothing else is wanted.
    """
    if config.notes == "light":
        return None
    try:
        return Recording.of(video)
    except InputError:
        if config.notes == "sound":
            raise
        return None


@dataclass(frozen=True, eq=False)
class _Timed:
    """The score in the time of the video.

    Attributes:
        score: the notes.
        facts: for `Demonstration.quality`.
        remarks: on the notes.
        certainty: how sure the notes are for another reason than the fingers, 0..1.
        outside: number of notes before or after the video, which are left out.
    """

    score: Score
    facts: dict[str, Any]
    remarks: list[Remark]
    certainty: float = 1.0
    outside: int = 0


class _Taken(NamedTuple):
    """The notes, the view in which they fit the video, and the hands in it.

    Attributes:
        view: number of the view.
        tracks: the tracked hands.
        timed: the notes.
        guessed: what they do not decide of the keyboard.
    """

    view: int
    tracks: HandTracks
    timed: _Timed
    guessed: tuple[Remark, ...] = ()


@dataclass(frozen=True, eq=False)
class _Seen:
    """What one pass over the video showed, in the best view.

    Attributes:
        view: the best one.
        tracks: the tracked hands.
        timed: the notes.
        look: of the keyboard.
        missing: (T,) bool, frames in which no keyboard is seen.
        remarks: on all of these but the notes.
    """

    view: View
    tracks: HandTracks
    timed: _Timed
    look: KeyboardLook
    missing: NDArray[np.bool_]
    remarks: list[Remark]


def _find_views(given: _Given, progress: Progress) -> list[View]:
    """The ways to see the keyboard in the video, the likeliest first."""
    if given.points is not None:
        return [view_of_points(given.points, given.film)]
    config = given.config
    views = find_views(given.film, MOST_FRAMES, config.octave, config.mirrored, progress)
    if not views:
        raise InputError(remark.no_keyboard(given.film.path, _told(config)))
    # Only notes can decide what is open; without them the likeliest is assumed.
    return views if given.score is not None or given.may_listen else views[:1]


def _told(config: RetargetConfig) -> list[str]:
    return remark.told_names(config.octave, config.mirrored)


def _on_told_names(given: _Given, view: View) -> list[Remark]:
    """Remarks on names of the keys that a user told, where the picture contradicts them."""
    if given.points is not None:
        return remark.on_told_names(
            view.track.usual, find_keyboards(background(given.film)), RETARGET
        )
    return remark.on_told_names(view.namings[0].plane, view.untold, RETARGET)


def _watch(given: _Given, views: list[View], progress: Progress) -> _Seen:
    """Read the video once: hands, keys, and from these the best view and the score."""
    with ExitStack() as records:
        lights = [records.enter_context(LightRecord(len(ZONES))) for _ in views]
        sightings = _detect(given, views, lights, progress)
        progress("notes", 0, 0)
        if given.score is None:
            taken = _from_video(given, views, sightings, lights, progress)
        else:
            taken = _from_score(given, given.score, views, sightings, lights)
        del sightings  # in hours of video, they take much memory
        view, light, tracks = views[taken.view], lights[taken.view], taken.tracks
        missing = view.track.missing(len(tracks))
        look = look_at_keyboard(light)
        remarks = [
            *taken.guessed,
            *_on_told_names(given, view),
            *remark.on_stretches(view, RETARGET),
            *remark.on_unseen_keyboard(missing),
            *remark.on_missing_hands(tracks),
            *remark.on_keyboard(look),
        ]
        if len(tracks) == MOST_FRAMES:
            text = f"what comes after {MAX_SECONDS / 3600:.0f} hours is left out"
            remarks.append(Remark(text, "cut the video, and retarget its parts"))
    return _Seen(view, tracks, taken.timed, look, missing, remarks)


def _detect(
    given: _Given, views: list[View], lights: list[LightRecord], progress: Progress
) -> Sightings:
    """Detect the hands in each frame and record the light of the keys, in one pass."""
    film = given.film
    readers = [KeyLight(view.track, given.film.working_size) for view in views]
    sightings = Sightings()
    total = round(film.seconds * FRAME_RATE)
    with HandDetector(given.hand_model) as detector:
        for number, frame in enumerate(islice(film.frames(FRAME_RATE), MOST_FRAMES)):
            sightings.append(detector.detect(frame.picture, round(number * 1000 / FRAME_RATE)))
            for reader, light in zip(readers, lights, strict=True):
                light.append(reader.read(number, frame.picture))
            progress("hands", number + 1, max(total, number + 1))
    return sightings


def _from_score(
    given: _Given,
    score: Score,
    views: list[View],
    sightings: Sightings,
    lights: list[LightRecord],
) -> _Taken:
    """The notes of a MIDI file or of the sound, in the view in which most have a finger on them."""
    heard = given.config.midi is None
    limits = (LATE_SOUND, LATEST_SOUND) if heard else (math.inf, math.inf)
    best: tuple[int, HandTracks, Offset] | None = None
    for number, (view, light) in enumerate(zip(views, lights, strict=True)):
        tracks = follow(sightings, given.film.working_size, view.track)
        missing = view.track.missing(len(tracks))
        offset = estimate_offset(score, tracks, light, missing, given.config.offset, *limits)
        if best is None or offset.touched > best[2].touched + _BETTER:
            best = number, tracks, offset
    assert best is not None
    number, tracks, offset = best
    _check_hands(given, tracks)
    timed = _place(given, score, offset, len(tracks) / FRAME_RATE)
    return _Taken(number, tracks, _checked(timed, tracks) if heard else timed)


def _checked(timed: _Timed, tracks: HandTracks) -> _Timed:
    """Notes of the sound without those that no hand can have played."""
    checked = check_heard(timed.score, tracks)
    facts = {"notes_doubted": checked.doubted, "notes_left_out": checked.left_out}
    return replace(
        timed,
        score=checked.score,
        facts={**timed.facts, **facts},
        remarks=[*timed.remarks, *remark.on_heard(checked)],
    )


def _from_video(
    given: _Given,
    views: list[View],
    sightings: Sightings,
    lights: list[LightRecord],
    progress: Progress,
) -> _Taken:
    """The notes of keys that light up, with what the sound says of them; or else of the sound."""
    view = views[0]
    tracks = follow(sightings, given.film.working_size, view.track)
    _check_hands(given, tracks)
    read = _read(given, view, lights[0], tracks)
    if read.lit:
        taken = _Taken(
            0, tracks, _read_score(read), tuple(remark.on_naming(view.namings, RETARGET))
        )
        if given.may_listen:
            return _fused(given, views, taken, sightings, lights, progress)
        return taken
    advice = "give that with --midi FILE"
    if given.may_listen:
        try:
            return _from_score(given, given.heard(progress), views, sightings, lights)
        except InputError as error:
            advice += f" (its sound is of no help: {error})"
    elif given.recording is not None:
        advice += f", or have its sound transcribed ({install_command('audio')})"
    raise InputError(
        f"{given.film.path}: keys do not light up in this film (confidence "
        f"{read.confidence:.0%}), so it does not show what is played: {advice}"
    )


def _check_hands(given: _Given, tracks: HandTracks) -> None:
    if not tracks.seen.any():
        raise InputError(f"{given.film.path}: no hands are seen playing")


def _read(given: _Given, view: View, light: LightRecord, tracks: HandTracks) -> ReadNotes:
    """The notes of keys that light up in a view."""
    return read_notes(light, tracks, view.track.missing(len(light)), title_of(given.film.path))


def _read_score(read: ReadNotes) -> _Timed:
    """The score read from keys that light up."""
    facts = {
        "notes_from": "video, from keys that light up",
        "keys_lit_confidence": round(read.confidence, 4),
    }
    return _Timed(on_grid(read.score), facts, [], read.confidence)


def _fused(
    given: _Given,
    views: list[View],
    taken: _Taken,
    sightings: Sightings,
    lights: list[LightRecord],
    progress: Progress,
) -> _Taken:
    """The notes of keys that light up, with what the sound says of them where it is theirs.

    What the video leaves open of the names of the keys, the sound decides.

    Args:
        given: the files.
        views: the ways to see the keyboard.
        taken: the notes as seen in the first view.
        sightings: hands in each frame.
        lights: of each view.
        progress: called while it listens.
    """
    timed = taken.timed
    try:
        heard = given.heard(progress)
    except InputError as error:
        said = remark.on_unused_sound(f"{error}".removeprefix(f"{given.film.path}: "))
        return taken._replace(timed=replace(timed, remarks=[*timed.remarks, *said]))
    early = given.config.offset
    ways = [taken]
    for number, (view, light) in enumerate(zip(views, lights, strict=True)):
        if number:
            tracks = follow(sightings, given.film.working_size, view.track)
            read = _read(given, view, light, tracks)
            guessed = tuple(remark.on_naming(view.namings, RETARGET))
            ways.append(_Taken(number, tracks, _read_score(read), guessed))
    late = None if early is None else -early
    number, fused, decided = name_by_sound([way.timed.score for way in ways], heard, late)
    best = ways[number]
    timed = best.timed
    remarks = [
        *timed.remarks,
        *(Remark(text) for text in heard.remarks),
        *remark.on_fused(fused, RETARGET),
    ]
    if not fused.alike:
        return taken._replace(timed=replace(taken.timed, remarks=remarks))
    facts = {
        **timed.facts,
        "notes_from": remark.KEYS_AND_SOUND,
        "offset_seconds": round(-fused.late, 4),
        "notes_seen_and_heard": fused.both,
        "notes_only_seen": fused.only_seen,
        "notes_only_heard": fused.only_heard,
    }
    return _Taken(
        best.view,
        best.tracks,
        replace(timed, score=on_grid(fused.score), facts=facts, remarks=remarks),
        () if decided else best.guessed,
    )


def _place(given: _Given, score: Score, offset: Offset, seconds: float) -> _Timed:
    """The score of the MIDI file, or else of the sound, in the time of a video of `seconds`."""
    midi, film = given.config.midi, given.film.path
    if given.config.offset is None and offset.touched < _TOO_FEW_TOUCHED:
        other = (
            f"{film}: its sound is not of what is seen"
            if midi is None
            else f"{midi} is not what is played in {film}"
        )
        raise InputError(
            f"{other}: at best {offset.touched:.0%} of its notes have a finger on their key, "
            f"{offset.by_chance:.0%} would by chance (it is another piece, or the keys are named "
            "wrongly: see `pianomime keyboard`; give --offset to go on anyway)"
        )
    begin, end = -offset.seconds, seconds - offset.seconds
    if end <= score.onset[0] or begin >= score.duration:
        raise InputError(f"{midi or film}: no note falls within {film} at this offset")
    if begin > 0:
        timed = score.clip(begin, end)
    else:
        cut = score.clip(0.0, end)
        timed = replace(
            cut, onset=cut.onset - begin, offset=cut.offset - begin, pedal=cut.pedal - begin
        )
    facts = {
        "notes_from": remark.SOUND if midi is None else shown(midi.name),
        "offset_seconds": round(offset.seconds, 4),
    }
    if midi is None:
        remarks = [
            *(Remark(text) for text in score.remarks),
            *remark.on_sound(score, offset, seconds),
        ]
    else:
        remarks = remark.on_midi(score, offset, seconds)
    return _Timed(on_grid(timed), facts, remarks, outside=len(score) - len(timed))

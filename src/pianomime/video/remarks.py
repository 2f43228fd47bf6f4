"""Remarks on a video: what was not seen, hidden, guessed or left out, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from pianomime.keyboard import FRAME_RATE, KEYS, key_name
from pianomime.music import Score
from pianomime.plan import LEFT, RIGHT, FingertipPlan
from pianomime.shown import command_word
from pianomime.video.advice import RETARGET, Advice
from pianomime.video.confidence import Confidence
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.keyboard.geometry import WHITE_WIDTH
from pianomime.video.keyboard.keyboard import Keyboard
from pianomime.video.keyboard.plane import Plane
from pianomime.video.keyboard.views import View
from pianomime.video.keyboard_look import KeyboardLook
from pianomime.video.notes.agreement import beyond
from pianomime.video.notes.fusion import Fused
from pianomime.video.notes.heard import Checked
from pianomime.video.notes.offset import LATE_SOUND, Offset
from pianomime.world.parameters import key_centres

_SHORTEST = 0.5
"""[s] Shorter intervals are not reported."""
_LEAST_LIKENESS = 0.5
"""Correlation with the usual look below which the keyboard is hidden or moved."""
_LEAST_PATTERN = 0.7
"""Correlation with white and black keys below which they are not where they should be; shifted by
white keys, or by a fifth of one, it is 0.65 at most."""
_AGREE, _MAY_AGREE = 0.7, 0.4
"""Agreement of notes and fingers beyond chance from which the notes are those that are played, and
below which they are probably not: those of other music have 0.35 at most in our films."""
_EARLY = 0.1
"""[s] Notes that begin at most so long before the video are not reported."""
_LONG_END = 2.0
"""[s] Video after the last note that is not reported."""
_OCTAVE = 12
"""Semitones."""

SOUND, KEYS_AND_SOUND = "sound", "video, from keys that light up, and its sound"
"""What the notes are from, if not from a MIDI file or from keys alone."""

Weight = Literal["note", "check", "wrong"]
"""What a remark means for the whole: nothing; that a user should check something; or that the
demonstration is probably wrong."""


@dataclass(frozen=True)
class Remark:
    """A remark on a video.

    Attributes:
        text: what was not seen, or is wrong, in one line.
        action: what to do about it, in one line; empty if there is nothing to do.
        weight: what it means for the whole demonstration.
    """

    text: str
    action: str = ""
    weight: Weight = "note"

    def __str__(self) -> str:
        return f"{self.text}: {self.action}" if self.action else self.text


def intervals(holds: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Intervals of at least half a second in which something holds.

    Args:
        holds: (T,) bool, frame by frame; single frames in which it does not are ignored.

    Returns:
        Beginning and end of each interval [s].
    """
    closed = binary_closing(np.pad(holds, 2), np.ones(3))[2:-2]
    edges = np.flatnonzero(np.diff(closed.astype(np.int8), prepend=0, append=0))
    return [
        (float(first / FRAME_RATE), float(end / FRAME_RATE))
        for first, end in edges.reshape(-1, 2)
        if end - first >= _SHORTEST * FRAME_RATE
    ]


def told_names(octave: int | None, mirrored: bool | None) -> list[str]:
    """The options by which a user names the keys."""
    told = [f"--octave {octave}"] if octave is not None else []
    if mirrored is not None:
        told.append("--mirrored" if mirrored else "--not-mirrored")
    return told


def no_keyboard(video: Path, told: Sequence[str] = ()) -> str:
    """What to do where no keyboard is found, in one line.

    Args:
        video: the video.
        told: options that name keys, where no naming agrees with them.
    """
    film = command_word(video)
    mark = f"mark where the keys are with `pianomime pick {film}`"
    show = f"`pianomime keyboard {film} --picture SEEN.png`"
    if told:
        options = " ".join(told)
        return (
            f"{video}: no keyboard found that agrees with {options}; {show} shows what is found "
            f"without {options}; if that is wrong, {mark}"
        )
    return (
        f"{video}: no keyboard found; try a film that shows more keys, sharp, from above, by a "
        f"camera that moves less ({show} shows what is looked at), or {mark}"
    )


def on_naming(keyboards: Sequence[Keyboard], advice: Advice) -> list[Remark]:
    """Remarks on what a picture leaves open about the names of the keys.

    Args:
        keyboards: the keyboard in each way to name its keys, the one that is assumed first.
        advice: of the command.
    """
    remarks: list[Remark] = []
    if len(keyboards) < 2:  # marked by a person, or sure
        return remarks
    assumed, *others = keyboards
    if any(other.lowest_c != assumed.lowest_c for other in others):
        text = f"the video leaves the octave open: {_lowest(assumed)}"
        remarks.append(Remark(text, advice.octave, "check"))
    if any(other.mirrored != assumed.mirrored for other in others):
        text = (
            "the video may be mirrored or not: "
            f"{'mirrored' if assumed.mirrored else 'not mirrored'} is assumed"
        )
        remarks.append(Remark(text, advice.mirror, "check"))
    return remarks


def _lowest(keyboard: Keyboard) -> str:
    """What the lowest key that is seen is taken for, in words; a C where there is one."""
    if keyboard.lowest_c is not None:
        return f"its lowest C is taken for C{keyboard.lowest_c}"
    return f"its lowest key is taken for {key_name(int(np.flatnonzero(keyboard.seen)[0]))}"


def on_stretches(view: View, advice: Advice) -> list[Remark]:
    """Remarks on stretches of a film whose names of keys are not sure, or contradict the others.

    Args:
        view: the way in which the keyboard is seen.
        advice: of the command.
    """
    guessed = [
        (
            frame,
            f"the camera shows a part of the keyboard whose octave is a guess: {_lowest(keyboard)}",
        )
        for frame, keyboard in view.guessed
    ]
    turned = [(frame, "the keyboard is mirrored unlike elsewhere") for frame in view.turned]
    return [
        Remark(f"from {frame / FRAME_RATE:.1f} s on {what}", advice.stretch, "check")
        for frame, what in sorted(guessed + turned)
    ]


def on_unseen_keyboard(missing: NDArray[np.bool_]) -> list[Remark]:
    """Remarks on intervals in which no keyboard is seen.

    Args:
        missing: (T,) bool, frames in which it is not.
    """
    return [
        Remark(
            f"no keyboard is seen from {first:.1f} s to {end:.1f} s: nothing is known there",
            "nothing if other pictures are shown there; else take a film that shows the keyboard",
        )
        for first, end in intervals(missing)
    ]


def on_told_names(plane: Plane, keyboards: Sequence[Keyboard], advice: Advice) -> list[Remark]:
    """Remarks on names of keys that a user told and the picture contradicts.

    Args:
        plane: as the user told it, by named points or options.
        keyboards: what is found in the picture without being told, in each way to name its keys.
        advice: of the command.
    """
    if not keyboards:
        return []
    centres = key_centres()[:, :2]
    for keyboard in keyboards:
        seen = np.flatnonzero(keyboard.seen)
        told = plane.to_world(keyboard.plane.to_pixels(centres[seen]))
        if np.median(np.abs(told[:, 1] - centres[seen, 1])) < WHITE_WIDTH / 2:
            return []
    middle = plane.to_pixels(centres[[KEYS // 2]])
    found = keyboards[0].plane.to_world(middle)[0, 1]
    name = key_name(int(np.abs(centres[:, 1] - found).argmin()))
    mirror = ", mirrored" if keyboards[0].mirrored else ""
    return [
        Remark(
            f"the picture contradicts the names of the keys that are given: what they call "
            f"{key_name(KEYS // 2)} looks like {name}{mirror}",
            advice.told,
            "check",
        )
    ]


def on_missing_hands(tracks: HandTracks) -> list[Remark]:
    """Remarks on hands that are not in the video."""
    return [
        Remark(
            f"only one hand is seen: the {name} one is made up, at rest",
            "nothing if one hand plays alone; else take a film in which both are in the picture",
        )
        for hand, name in ((LEFT, "left"), (RIGHT, "right"))
        if not tracks.seen[hand]
    ]


def on_lost_hands(tracks: HandTracks, missing: NDArray[np.bool_]) -> list[Remark]:
    """Remarks on intervals in which a keyboard is seen, but a hand is not.

    Args:
        tracks: the tracked hands.
        missing: (T,) bool, frames in which no keyboard is seen.
    """
    return [
        Remark(
            f"the {'left' if hand == LEFT else 'right'} hand is not seen from {first:.1f} s to "
            f"{end:.1f} s",
            "leave these seconds out (--start and --seconds of `play` and `train-expert`), or take "
            "a film in which both hands are whole in the picture",
        )
        for first, end, hand in poorly_seen(tracks, missing)
    ]


def poorly_seen(tracks: HandTracks, missing: NDArray[np.bool_]) -> list[tuple[float, float, int]]:
    """Intervals of at least half a second in which a keyboard is seen, but a hand is not.

    Args:
        tracks: the tracked hands.
        missing: (T,) bool, frames in which no keyboard is seen.

    Returns:
        Beginning and end [s] and the hand of each, in order of time.
    """
    return sorted(
        (first, end, hand)
        for hand in (LEFT, RIGHT)
        for first, end in intervals(~tracks.found[:, hand] & ~missing)
    )


def on_keyboard(look: KeyboardLook) -> list[Remark]:
    """Remarks on keys that are not where they should be, all the time or after a cut or a move."""
    if look.pattern is None:
        return [
            Remark(
                "the far ends of the keys are outside the picture: whether the keyboard moves, or "
                "is marked wrongly, does not show",
                "look at the pictures on the page: the grid must lie on the keys to the end",
            )
        ]
    if look.pattern < _LEAST_PATTERN:
        return [
            Remark(
                "black and white keys are not where they should be: they agree by "
                f"{look.pattern:.2f} of 1, as on a keyboard that is shifted",
                "mark the keyboard with `pianomime pick`",
                "wrong",
            )
        ]
    return [
        Remark(
            f"the keyboard is not where it was, or hidden, from {first:.1f} s to {end:.1f} s",
            "leave these seconds out, or cut the film there and retarget each part",
            "check",
        )
        for first, end in intervals(look.usual < _LEAST_LIKENESS)
    ]


def on_sound(score: Score, offset: Offset, seconds: float) -> list[Remark]:
    """Remarks on the part of a video in which nothing is heard, and on a sound that is late.

    Args:
        score: all notes that are heard.
        offset: where they lie in the video.
        seconds: length of the video [s].
    """
    remarks = on_late_sound(-offset.seconds, RETARGET)
    silence = seconds - offset.seconds - score.duration
    if silence > _LONG_END:
        text = f"the video goes on for {silence:.1f} s after the last note that is heard"
        remarks.append(Remark(text, "nothing if nothing is played there"))
    return remarks


def on_late_sound(late: float, advice: Advice) -> list[Remark]:
    """Remarks on a sound that is not in time with its pictures.

    Args:
        late: how much later it is [s].
        advice: of the command.
    """
    if abs(late) <= LATE_SOUND:
        return []
    when = "later" if late > 0 else "earlier"
    return [
        Remark(
            f"the sound is {abs(late):.2f} s {when} than the pictures, by the notes in both: its "
            "notes are moved there",
            advice.late.format(offset=-late),
            "check",
        )
    ]


def on_heard(checked: Checked) -> list[Remark]:
    """Remarks on notes of the sound that hands cannot have played.

    Args:
        checked: notes that were compared with the hands.
    """
    remarks = []
    if checked.left_out:
        text = (
            f"{checked.left_out} notes that are heard are left out: no finger is near their key, "
            "and each is a harmonic of a louder one at the same time"
        )
        remarks.append(Remark(text))
    if checked.doubted:
        text = (
            f"{checked.doubted} of {len(checked.score)} notes that are heard have no finger near "
            "their key when they begin, though both hands are seen: they are kept, and doubtful"
        )
        remarks.append(Remark(text, "look at them on the page; a MIDI file (--midi) would decide"))
    return remarks


def on_fused(fused: Fused, advice: Advice) -> list[Remark]:
    """Remarks on how the notes that are seen and those that are heard agree.

    Args:
        fused: what became of both.
        advice: of the command.
    """
    seen, heard = fused.both + fused.only_seen, fused.both + fused.only_heard
    if not fused.alike:
        return on_unused_sound(
            f"{fused.both} of {seen} notes that are seen are among the {heard} that are heard"
        )
    text = (
        f"{fused.both} of {seen} notes are seen and heard; {fused.only_seen} only seen are kept, "
        f"{fused.only_heard} only heard are left out"
    )
    return [*on_late_sound(fused.late, advice), Remark(text)]


def on_unused_sound(why: str) -> list[Remark]:
    """Remarks on a sound that says nothing about the notes that are seen.

    Args:
        why: how that shows.
    """
    return [Remark(f"the notes are those that are seen; the sound is of no help: {why}")]


def on_agreement(confidence: Confidence, source: str, offset: float | None) -> list[Remark]:
    """Remarks on notes that agree with the fingers hardly better than by chance.

    Args:
        confidence: in the demonstration.
        source: what the notes are from: the name of a MIDI file, `SOUND`, or else keys.
        offset: offset of a MIDI file or of the sound [s]; None for notes of the keys.
    """
    if source == KEYS_AND_SOUND:
        offset = None  # their time is that of the light; the offset is the sound's
    agreed, better, tempo = confidence.agreement, confidence.better, confidence.tempo
    fits = 0.0 if better is None else better.touched
    if (
        offset is not None
        and tempo is not None
        and tempo.touched > fits
        and beyond(tempo.touched, agreed.chance) >= _AGREE
    ):
        percent = abs(100 * (tempo.ratio - 1))
        slower = "slower" if tempo.ratio > 1 else "faster"
        what = "its sound" if source == SOUND else source
        return [
            Remark(
                f"the film seems to be {percent:.0f} % {slower} than {what}: {tempo.touched:.0%} "
                f"of the notes would have a finger on their key at its speed, {tempo.now:.0%} at "
                "most have one at theirs",
                "give a MIDI file at the speed of the film (--midi)",
                "wrong" if agreed.beyond_chance < _MAY_AGREE else "check",
            )
        ]
    if better is not None and better.keys:
        far = abs(better.keys)
        up = "higher" if better.keys > 0 else "lower"
        distance = {1: "a semitone", _OCTAVE: "an octave", 2 * _OCTAVE: "two octaves"}.get(
            far, f"{far} semitones"
        )
        return [
            Remark(
                f"the notes fit the fingers better {distance} {up}: {better.touched:.0%} of them "
                f"then have a finger on their key, now {better.now:.0%}; the keys are named "
                "wrongly, or the piano was transposed",
                "name the octave with --octave, try --mirrored, or transpose the MIDI file",
                "wrong",
            )
        ]
    if better is not None:
        late = f"{abs(better.seconds):.1f} s {'later' if better.seconds > 0 else 'earlier'}"
        there = "" if offset is None else f" {offset + better.seconds:.1f}"
        return [
            Remark(
                f"the notes fit the fingers better {late}: {better.touched:.0%} of them then have "
                f"a finger on their key, now {better.now:.0%}",
                f"try --offset{there}, or leave it out: then it is estimated",
                "wrong",
            )
        ]
    if agreed.beyond_chance >= _AGREE:
        return []
    action = "give the MIDI file of this performance (--midi)"
    if offset is None:
        what = "the notes that are read from the keys are doubtful"
    else:
        what = (
            "the sound may not be of what is seen"
            if source == SOUND
            else f"{source} may not be what is played"
        )
        action += ", or the offset (--offset)"
    action += "; if the grid on the page is not on the keys, mark them with `pianomime pick`"
    return [
        Remark(
            f"{what}: {agreed.share:.0%} of its notes have a finger on their key, "
            f"{agreed.chance:.0%} on other keys or at other times",
            action,
            "wrong" if agreed.beyond_chance < _MAY_AGREE else "check",
        )
    ]


def on_midi(score: Score, offset: Offset, seconds: float) -> list[Remark]:
    """Remarks on the parts of a MIDI file and a video that do not overlap.

    Args:
        score: the whole MIDI file.
        offset: where it lies in the video.
        seconds: length of the video [s].
    """
    remarks = []
    begin, end = -offset.seconds, seconds - offset.seconds
    early = int((score.onset < begin - _EARLY).sum())
    late = int((score.onset >= end).sum())
    action = "nothing if the film shows a part of the piece; else give --offset"
    if early:
        text = f"{early} notes of the MIDI file come before the video begins"
        remarks.append(Remark(text, action))
    if late:
        remarks.append(Remark(f"{late} notes of the MIDI file come after the video ends", action))
    if end > score.duration + _LONG_END:
        more = end - score.duration
        remarks.append(
            Remark(
                f"the video goes on for {more:.1f} s after the MIDI file's last note, with which "
                "the demonstration ends"
            )
        )
    return remarks


def on_fingering(confidence: Confidence, plan: FingertipPlan) -> list[Remark]:
    """Remarks on notes whose finger was guessed, and on notes that no finger plays."""
    remarks = []
    notes, guessed = len(plan.note_hand), int((~confidence.supported).sum())
    if guessed:
        remarks.append(
            Remark(
                f"at the onset of {guessed} of {notes} notes no finger is on the key: which finger "
                "plays them is a guess",
                "look at the worst moments on the page; if those notes are wrong, give a MIDI file "
                "without them (--midi), else take a film in which hands hide less",
            )
        )
    if plan.dropped:
        text = f"{plan.dropped} of {notes} notes are played by no finger"
        remarks.append(Remark(text, "leave out --align paper: by default all are played"))
    return remarks

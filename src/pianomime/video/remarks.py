"""Remarks on a video: one line each on what was not seen, hidden, guessed or left out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.plan import LEFT, RIGHT, FingertipPlan
from pianomime.video.film.light_record import LightRecord
from pianomime.video.hands.tracks import HandTracks
from pianomime.video.keyboard.keyboard import Keyboard
from pianomime.video.keyboard.views import View
from pianomime.video.notes.fingers import NoteFingers
from pianomime.video.notes.fusion import Fused
from pianomime.video.notes.heard import Checked
from pianomime.video.notes.key_light import ZONES
from pianomime.video.notes.offset import LATE_SOUND, Offset

_SHORTEST = 0.5
"""[s] Shorter intervals are not reported."""
_SOME_FRAMES = 2000
"""Frames from which the usual look of the keyboard is taken."""
_LEAST_LIKENESS = 0.5
"""Correlation with the usual look below which the keyboard is hidden or moved."""
_EARLY = 0.1
"""[s] Notes that begin at most so long before the video are not reported."""
_LONG_END = 2.0
"""[s] Video after the last note that is not reported."""


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


def on_naming(keyboards: Sequence[Keyboard]) -> list[str]:
    """Remarks on what a picture leaves open about the names of the keys.

    Args:
        keyboards: the keyboard in each way to name its keys, the one that is assumed first.
    """
    remarks: list[str] = []
    if len(keyboards) < 2:  # marked by a person, or sure
        return remarks
    assumed, *others = keyboards
    if any(other.lowest_c != assumed.lowest_c for other in others):
        remarks.append(
            f"the video leaves the octave open: its lowest C is taken for C{assumed.lowest_c} "
            "(--octave names it; a MIDI file would decide)"
        )
    if any(other.mirrored != assumed.mirrored for other in others):
        remarks.append(
            "the video may be mirrored or not: "
            f"{'mirrored' if assumed.mirrored else 'not mirrored'} is assumed (--mirrored or "
            "--not-mirrored tells it; a MIDI file would decide)"
        )
    return remarks


def on_stretches(view: View) -> list[str]:
    """Remarks on stretches of a film whose octave is not sure."""
    return [
        f"from {frame / FRAME_RATE:.1f} s on the camera shows a part of the keyboard whose octave "
        f"is a guess: its lowest C is taken for C{keyboard.lowest_c}"
        for frame, keyboard in view.guessed
    ]


def on_unseen_keyboard(missing: NDArray[np.bool_]) -> list[str]:
    """Remarks on intervals in which no keyboard is seen.

    Args:
        missing: (T,) bool, frames in which it is not.
    """
    return [
        f"no keyboard is seen from {first:.1f} s to {end:.1f} s: that is left out"
        for first, end in intervals(missing)
    ]


def on_missing_hands(tracks: HandTracks) -> list[str]:
    """Remarks on hands that are not in the video."""
    return [
        f"only one hand is seen: the {name} one is made up, at rest"
        for hand, name in ((LEFT, "left"), (RIGHT, "right"))
        if not tracks.seen[hand]
    ]


def on_lost_hands(tracks: HandTracks) -> list[str]:
    """Remarks on intervals in which a hand was not seen."""
    return [
        f"the {'left' if hand == LEFT else 'right'} hand is not seen from {first:.1f} s to "
        f"{end:.1f} s"
        for first, end, hand in poorly_seen(tracks)
    ]


def poorly_seen(tracks: HandTracks) -> list[tuple[float, float, int]]:
    """Intervals of at least half a second in which a hand was not seen.

    Returns:
        Beginning and end [s] and the hand of each, in order of time.
    """
    return sorted(
        (first, end, hand)
        for hand in (LEFT, RIGHT)
        for first, end in intervals(~tracks.found[:, hand])
    )


def on_keyboard(light: LightRecord) -> list[str]:
    """Remarks on intervals in which the keyboard does not look as usual: after a cut, or a move."""
    far_end = list(ZONES).index("far end")
    some = light.every(max(1, len(light) // _SOME_FRAMES), far_end)
    usual = np.median(some.mean(axis=2), axis=0)
    usual = usual - usual.mean()
    if not usual.any():
        return []  # the far ends of the keys are outside the picture
    likeness = []
    for block in light.blocks(far_end):
        level = block.mean(axis=2)
        level = level - level.mean(axis=1, keepdims=True)
        norm = np.linalg.norm(level, axis=1) * np.linalg.norm(usual) + 1e-9
        likeness.append(level @ usual / norm)
    return [
        f"the keyboard is not where it was, or hidden, from {first:.1f} s to {end:.1f} s"
        for first, end in intervals(np.concatenate(likeness) < _LEAST_LIKENESS)
    ]


def on_sound(score: Score, offset: Offset, seconds: float) -> list[str]:
    """Remarks on how the sound of a video fits its pictures.

    Args:
        score: all notes that are heard.
        offset: where they lie in the video.
        seconds: length of the video [s].
    """
    remarks = on_late_sound(-offset.seconds)
    silence = seconds - offset.seconds - score.duration
    if silence > _LONG_END:
        remarks.append(f"the video goes on for {silence:.1f} s after the last note that is heard")
    if not offset.matches:
        remarks.append(
            f"the sound may not be of what is seen: {offset.touched:.0%} of its notes have a "
            f"finger on their key, {offset.by_chance:.0%} would by chance"
        )
    return remarks


def on_late_sound(late: float) -> list[str]:
    """Remarks on a sound that is not in time with its pictures.

    Args:
        late: how much later it is [s].
    """
    if abs(late) <= LATE_SOUND:
        return []
    when = "later" if late > 0 else "earlier"
    return [
        f"the sound is {abs(late):.2f} s {when} than the pictures, by the notes in both: its notes "
        f"are moved there; if that is wrong, give --offset {-late:.2f} another value"
    ]


def on_heard(checked: Checked) -> list[str]:
    """Remarks on notes of the sound that hands cannot have played.

    Args:
        checked: notes that were compared with the hands.
    """
    remarks = []
    if checked.left_out:
        remarks.append(
            f"{checked.left_out} notes that are heard are left out: no finger is near their key, "
            "and each is a harmonic of a louder one at the same time"
        )
    if checked.doubted:
        remarks.append(
            f"{checked.doubted} of {len(checked.score)} notes that are heard have no finger near "
            "their key when they begin, though both hands are seen: they are kept, and doubtful"
        )
    return remarks


def on_fused(fused: Fused) -> list[str]:
    """Remarks on how the notes that are seen and those that are heard agree.

    Args:
        fused: what became of both.
    """
    seen, heard = fused.both + fused.only_seen, fused.both + fused.only_heard
    if not fused.alike:
        return on_unused_sound(
            f"{fused.both} of {seen} notes that are seen are among the {heard} that are heard"
        )
    return [
        *on_late_sound(fused.late),
        f"{fused.both} of {seen} notes are seen and heard; {fused.only_seen} only seen are kept, "
        f"{fused.only_heard} only heard are left out",
    ]


def on_unused_sound(why: str) -> list[str]:
    """Remarks on a sound that says nothing about the notes that are seen.

    Args:
        why: how that shows.
    """
    return [f"the notes are those that are seen; the sound is of no help: {why}"]


def on_midi(midi: str, score: Score, offset: Offset, seconds: float) -> list[str]:
    """Remarks on how a MIDI file fits a video.

    Args:
        midi: name of the MIDI file.
        score: the whole MIDI file.
        offset: where it lies in the video.
        seconds: length of the video [s].
    """
    remarks = []
    if not offset.matches:
        remarks.append(
            f"{midi} may not be what is played: {offset.touched:.0%} of its notes have a finger "
            f"on their key, {offset.by_chance:.0%} would by chance"
        )
    begin, end = -offset.seconds, seconds - offset.seconds
    early = int((score.onset < begin - _EARLY).sum())
    late = int((score.onset >= end).sum())
    if early:
        remarks.append(f"{early} notes of the MIDI file come before the video begins")
    if late:
        remarks.append(f"{late} notes of the MIDI file come after the video ends")
    if end > score.duration + _LONG_END:
        remarks.append(
            f"the video goes on for {end - score.duration:.1f} s after the MIDI file's last note"
        )
    return remarks


def on_fingering(fingers: NoteFingers, plan: FingertipPlan) -> list[str]:
    """Remarks on notes whose finger was guessed, and on notes that no finger plays."""
    remarks = []
    notes = len(plan.note_hand)
    if fingers.guessed.any():
        remarks.append(
            f"{int(fingers.guessed.sum())} of {notes} notes have no finger near their key: "
            "theirs is a guess"
        )
    if plan.dropped:
        remarks.append(f"{plan.dropped} of {notes} notes are played by no finger")
    return remarks

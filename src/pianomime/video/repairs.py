"""Repairs: what was interpolated, replaced, guessed or left out in a demonstration of a video."""

from __future__ import annotations

from dataclasses import dataclass

from pianomime.plan import LEFT, RIGHT, FingertipPlan
from pianomime.video.confidence import Confidence
from pianomime.video.hands.tracks import HandTracks


@dataclass(frozen=True)
class Repair:
    """One kind of repair.

    Attributes:
        name: as it is stored.
        text: what was repaired, in plain words.
        count: how many.
        total: of how many; None where that says nothing.
    """

    name: str
    text: str
    count: int
    total: int | None = None


def list_repairs(
    tracks: HandTracks, plan: FingertipPlan, confidence: Confidence, notes_outside: int
) -> list[Repair]:
    """List all kinds of repairs, also those of which there were none.

    Args:
        tracks: the tracked hands.
        plan: the plan made of them.
        confidence: in it.
        notes_outside: notes of a MIDI file, or of the sound, before or after the video.
    """
    frames, notes = len(tracks), len(plan.note_hand)
    unseen = (~tracks.found).sum(axis=0)
    swapped = "frames in which left and right hand were taken for each other, and swapped back"
    return [
        Repair(
            "left_hand_interpolated",
            "frames in which the left hand was not seen, and is interpolated",
            int(unseen[LEFT]),
            frames,
        ),
        Repair(
            "right_hand_interpolated",
            "frames in which the right hand was not seen, and is interpolated",
            int(unseen[RIGHT]),
            frames,
        ),
        Repair(
            "points_mended",
            "points of hands that were far from where they were before and after, and are replaced",
            int(tracks.mended.sum()),
            tracks.mended.size,
        ),
        Repair("hands_swapped_back", swapped, tracks.swaps, frames),
        Repair(
            "detections_left_out",
            "detections that were neither hand, or one hand twice, and are left out",
            tracks.ghosts,
        ),
        Repair(
            "fingers_guessed",
            "notes with no finger on their key when they begin: the finger is a guess",
            int((~confidence.supported).sum()),
            notes,
        ),
        Repair("notes_not_played", "notes that no finger plays", plan.dropped, notes),
        Repair(
            "notes_outside",
            "notes before or after the video, which are left out",
            notes_outside,
            notes + notes_outside,
        ),
    ]

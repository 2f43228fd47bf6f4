"""Verdict on a demonstration made from a video: whether to use it, in one line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pianomime.keyboard import FRAME_RATE
from pianomime.video.confidence import Confidence
from pianomime.video.remarks import Remark

_FEW_GUESSED = 0.02
"""Share of notes whose finger may be a guess in a good demonstration."""
_SHORT_DOUBT = 0.02
"""Share of the frames with a keyboard that may be in doubt in a good demonstration."""
_MUCH_DOUBT = 0.5
"""Share of the frames with a keyboard in doubt from which the whole demonstration is."""


@dataclass(frozen=True)
class Verdict:
    """Whether to use a demonstration.

    Attributes:
        grade: good, usable, or doubtful.
        line: why, and what to do, in plain words.
    """

    grade: Literal["good", "usable", "doubtful"]
    line: str


def judge(confidence: Confidence, remarks: Sequence[Remark]) -> Verdict:
    """Judge a demonstration.

    Args:
        confidence: in it, frame by frame.
        remarks: on its making.
    """
    shown = ~confidence.missing
    doubt = confidence.in_doubt[shown]
    guessed, notes = int((~confidence.supported).sum()), len(confidence.supported)
    wrong = [remark for remark in remarks if remark.weight == "wrong"]
    if wrong:
        first = wrong[0]
        return Verdict("doubtful", f"Doubtful: {first.text}. To do: {first.action}.")
    seconds = f"{doubt.sum() / FRAME_RATE:.1f} s of {shown.sum() / FRAME_RATE:.1f} s are in doubt"
    unseen = _unseen(confidence)
    if doubt.mean() >= _MUCH_DOUBT:
        return Verdict(
            "doubtful",
            f"Doubtful: {seconds}{unseen}. To do: see why at the worst moments on the page.",
        )
    check = [remark.text for remark in remarks if remark.weight == "check"]
    if guessed <= _FEW_GUESSED * notes and doubt.mean() <= _SHORT_DOUBT and not check:
        return Verdict("good", f"Good: use it as it is{unseen}.")
    reasons = [f"the finger is guessed of {guessed} of {notes} notes"] if guessed else []
    reasons += [seconds] if doubt.any() else []
    if check:
        doubts = "; ".join([check[0], *reasons])
        return Verdict("usable", f"Usable, but check first: {doubts}{unseen}.")
    return Verdict("usable", f"Usable: {'; '.join(reasons)}{unseen}.")


def _unseen(confidence: Confidence) -> str:
    """What is added where some of the video shows no keyboard."""
    missing = float(confidence.missing.sum() / FRAME_RATE)
    return f"; {missing:.1f} s more show no keyboard" if missing else ""

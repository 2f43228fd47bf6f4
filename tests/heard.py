"""What is heard when a tracker follows a plan, and how it differs from what should be."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pianomime.keyboard import FRAME_SECONDS
from pianomime.music import Score
from pianomime.plan import FingertipPlan, ZeroShotConfig, ZeroShotPlanner
from pianomime.plan.fingering_cost import FingeringConfig
from pianomime.track import Controller, Tracker, controls_per_frame
from pianomime.track.heard import Strike, strikes_in
from pianomime.world import World
from pianomime.world.touch import TOUCHES

NEAR = 0.15
"""[s] A strike further than this from a note is another one."""
LEAD_IN = 0.34
"""[s] In which hands get to their keys."""


class Heard(NamedTuple):
    """Against M strikes that should be heard.

    Attributes:
        late: (M,) by how much each was late [s], NaN where it was missed.
        velocity: (M,) MIDI velocity with which it was struck, NaN likewise.
        phantoms: number of strikes that nobody wanted.
    """

    late: NDArray[np.float64]
    velocity: NDArray[np.float64]
    phantoms: int

    @property
    def missed(self) -> int:
        return int(np.isnan(self.late).sum())


def notes(key: ArrayLike, onset: ArrayLike, lasts: float = 0.2, velocity: ArrayLike = 70) -> Score:
    """After the lead-in."""
    begin = LEAD_IN + np.array(onset, float)
    return Score(np.array(key), begin, begin + lasts, np.broadcast_to(velocity, len(begin)).copy())


def scale(lowest: int = 39, velocity: ArrayLike = 70) -> Score:
    """Up and down, with onsets all over the frame."""
    steps = np.array([0, 2, 4, 5, 7, 9, 11, 12, 11, 9, 7, 5, 4, 2])
    return notes(lowest + steps, np.arange(len(steps)) * 0.247, velocity=velocity)


def plan_of(score: Score) -> FingertipPlan:
    """As the zero-shot player plans."""
    return ZeroShotPlanner(ZeroShotConfig(fingering=FingeringConfig.notes())).plan(score)


def play(controller: Controller) -> tuple[NDArray[np.float64], list[Strike]]:
    """The controls, and all that sounds."""
    world, parts = World(), controls_per_frame(controller)
    ctrl, heard = [], []
    for number in range(len(controller.plan) * parts):
        ctrl.append(controller.control(number, world))
        world.step(ctrl[-1], parts=parts)
        heard += strikes_in(world.key_events, number * FRAME_SECONDS / parts)
    return np.array(ctrl), heard


def listen(tracker: Tracker, plan: FingertipPlan, score: Score) -> Heard:
    """What is heard of the notes of a score, all of which are played."""
    return compare(play(tracker.start(plan))[1], score)


def compare(heard: list[Strike], score: Score) -> Heard:
    """Nearest pairs first."""
    late = np.full(len(score), np.nan)
    velocity = np.full(len(score), np.nan)
    pairs = sorted(
        (abs(strike.time - score.onset[note]), note, index)
        for index, strike in enumerate(heard)
        for note in np.flatnonzero(score.key == strike.key).tolist()
    )
    used = set()
    for apart, note, index in pairs:
        if apart <= NEAR and np.isnan(late[note]) and index not in used:
            used.add(index)
            late[note] = heard[index].time - score.onset[note]
            touch = TOUCHES["goebl-bresin"]
            velocity[note] = touch.velocity_of(heard[index].speed, heard[index].key)
    return Heard(late, velocity, len(heard) - len(used))

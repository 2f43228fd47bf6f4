"""Scores and performances made up for tests of what is done with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import NO_KEY
from pianomime.music import Score, notes_from_roll
from pianomime.plan import FingertipPlan
from pianomime.players.performance import Performance
from pianomime.world import World
from pianomime.world_names import PAPER

MIDDLE_C = 39


def score(notes: int = 60, seconds: float = 8.0, title: str = "made up", seed: int = 0) -> Score:
    """Random notes on both sides of middle C, and some pedal."""
    draw = np.random.default_rng(seed)
    onset = np.sort(draw.uniform(0, seconds - 0.5, notes))
    onset[0] = 0.0
    return Score(
        key=draw.integers(20, 66, notes),
        onset=onset,
        offset=onset + draw.uniform(0.1, 0.5, notes),
        velocity=draw.integers(30, 110, notes),
        pedal=np.array([[0.5, 2.0], [3.0, 3.5]]),
        title=title,
    )


def plan(score: Score) -> FingertipPlan:
    """Each note to the hand of its side; the first note to none."""
    frames = len(score.roll())
    hand = np.where(score.key < MIDDLE_C, 0, 1).astype(np.int8)
    hand[0] = -1
    return FingertipPlan(
        fingertips=np.linspace(0, 1, frames * 36).reshape(frames, 2, 6, 3),
        finger_key=np.full((frames, 2, 5), NO_KEY, np.int8),
        note_hand=hand,
        note_finger=np.where(hand < 0, -1, 2).astype(np.int8),
    )


def performance(
    score: Score, mistakes: float = 0.1, planned: bool = True, seed: int = 0
) -> Performance:
    """The score played with a share of its notes missed, late or on the next key."""
    draw = np.random.default_rng(seed)
    frames = len(score.roll())
    pressed = np.zeros((frames, 88), bool)
    for key, (first, stop) in zip(score.key, score.note_frames(), strict=True):
        luck = draw.random()
        if luck < mistakes:
            continue
        if luck < 2 * mistakes:
            first += 1
        if luck > 1 - mistakes / 2:
            key += 1
        pressed[first:stop, key] = True
    key, on, off = notes_from_roll(pressed)
    return Performance(
        score=score,
        player="made up",
        effort=2,
        touch="goebl-bresin",
        works_pedal=False,
        world="paper",
        plan=plan(score) if planned else None,
        ctrl=draw.normal(size=(frames, 1, 46)),
        qpos=draw.normal(size=(frames, 142)),
        key_state=pressed * 0.97,
        pressed=pressed,
        pedal=score.pedal_roll(),
        event_key=key,
        event_on=on,
        event_off=off,
        event_speed=draw.uniform(0.1, 1.0, len(key)),
        pedal_times=score.pedal,
        blow_ups=np.array([3], np.int64),
        plan_seconds=0.25,
        simulate_seconds=0.5,
    )


def silent(frames: int) -> Performance:
    """A performance of one note, held all the time, whose motion is still to be filled in."""
    one = np.array([MIDDLE_C])
    end = (frames - 1) / 20
    song = Score(one, 0.0 * one, 0 * one + end, 0 * one + 64, np.empty((0, 2)), "one note")
    made = performance(song)
    assert len(made) == frames
    return replace(made, blow_ups=np.array([], np.int64))


def performed(ctrl: NDArray[np.float64], world: str = PAPER) -> Performance:
    """A performance of controls (T, S, 46), as a World plays them."""
    played, qpos = World(world), []
    for row in ctrl:
        played.step(row)
        qpos.append(played.qpos)
    return replace(silent(len(ctrl)), ctrl=ctrl, qpos=np.array(qpos), world=world)

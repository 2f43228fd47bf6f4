"""Live replays: written to files while a score is still being played."""

from __future__ import annotations

import time
from typing import IO

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, FRAME_SECONDS
from pianomime.music import Score
from pianomime.music.sound import PEAK, live_sound
from pianomime.players.player import Player
from pianomime.players.rollout import Step
from pianomime.players.sounding_notes import SoundingNotes
from pianomime.replay import (
    POSE_SUBSTEPS,
    POSES_PER_SECOND,
    head_block,
    heard_block,
    move_block,
    notes_block,
    pedal_block,
    scene_block,
)
from pianomime.replay.blocks import json_block
from pianomime.report.mp3 import Mp3
from pianomime.track import Controller, PedalController
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world.touch import TOUCHES

_BATCH_FRAMES = 10
"""Frames that are written together."""
_FIRST_SOUND_FRAMES, _MOST_SOUND_FRAMES = 10, 80
"""Frames whose sound is made together: few at first, so that something is heard soon, then more,
for each part is made with the ten seconds before it."""
_TOLD_SECONDS = 0.1
"""[s] At most so often the page is told how far the planning is."""
_MEASURED_SECONDS = 10.0
"""[s] Music by whose loudest moment all of it is scaled, as long as the rest is not known."""
_HEADROOM = 0.7
"""Of the loudness that it would have then, for what is louder later."""
_RINGING = 60.0
"""[s] How long a note may sound whose end is not known."""


class LiveReplay:
    """Writes the replay and the sound of a score while a player plays it.

    It is an `Observer`, and its `progress` is to be told as well.

    Args:
        score: what is played.
        player: who plays.
        replay: file for the blocks, unbuffered.
        sound: what takes the sound, at `SAMPLE_RATE`.
    """

    def __init__(self, score: Score, player: Player, replay: IO[bytes], sound: Mp3) -> None:
        self._score, self._player = score, player
        self._replay, self._sound = replay, sound
        self._notes, self._pedal = SoundingNotes(), score.pedal
        self._poses: list[NDArray[np.float64]] = [np.zeros(LAYOUT.qpos_size)]
        self._written, self._substeps, self._frames = 0, 0, 0
        self._sounded, self._sound_due = 0, _FIRST_SOUND_FRAMES
        self._heard = np.empty((0, 3))
        self._gain: float | None = None
        self._told = -np.inf
        self._pedalled: list[bool] = []
        head = head_block(
            score, player.name, player.effort, player.world, player.touch, POSES_PER_SECOND
        )
        self._write(head, scene_block(), notes_block(score, None), pedal_block(score.pedal))

    def progress(self, phase: str, done: int, total: int, remark: str = "") -> None:
        """Tell the page how far the planning is."""
        now = time.monotonic()
        if not self._frames and now - self._told > _TOLD_SECONDS:
            self._told = now
            self._write(json_block("PLAN", {"phase": phase, "done": done, "total": total}))

    def planned(self, controller: Controller) -> None:
        """Show who will play each note."""
        self._works_pedal = isinstance(controller, PedalController)
        self._write(notes_block(self._score, controller.plan))

    def watch(self, world: World) -> None:
        """Take down every second physics step."""
        self._substeps += 1
        if self._substeps % POSE_SUBSTEPS == 0:
            self._poses.append(world.data.qpos.copy())

    def played(self, step: Step) -> None:
        """Take down what sounded, and write what is due."""
        self._notes.add(step.key_events, step.frame * FRAME_SECONDS)
        self._pedalled.append(step.pedal)
        self._frames += 1
        last = self._frames == self._score.frames()
        if self._frames == self._sound_due or last:
            self._write_sound()
        if self._frames % _BATCH_FRAMES == 0 or last:
            self._write_motion()

    def _write(self, *blocks: bytes) -> None:
        for block in blocks:
            self._replay.write(block)

    def _write_motion(self) -> None:
        # Where the physics broke, what came before the recovery may be no number.
        positions = np.nan_to_num(np.array(self._poses), nan=0.0, posinf=0.0, neginf=0.0)
        self._write(move_block(self._written, positions))
        self._written += len(positions)
        self._poses.clear()
        now = self._frames * FRAME_SECONDS
        played = self._played(now)
        rows = np.stack([played.key, played.onset, played.offset], axis=1)
        common = min(len(rows), len(self._heard))
        changed = (rows[:common] != self._heard[:common]).any(axis=1)
        first = int(np.argmax(changed)) if changed.any() else common
        if first < len(rows):
            self._write(heard_block(_from(played, first), first))
        self._heard = rows
        if self._works_pedal:
            self._write(pedal_block(played.pedal))

    def _write_sound(self) -> None:
        begin, now = self._sounded * FRAME_SECONDS, self._frames * FRAME_SECONDS
        # A note that still sounds ends later than this stretch.
        played = self._played(now, now + _RINGING)
        if self._gain is None:
            self._gain = _gain(self._score)
        made = self._gain * live_sound(played, begin, now - begin)
        self._sound.add(np.clip(made, -1.0, 1.0))
        self._sound_due += min(self._frames, _MOST_SOUND_FRAMES)
        self._sounded = self._frames

    def _played(self, now: float, sounding_until: float | None = None) -> Score:
        """What sounded so far; notes that still sound end at the time given, else now."""
        made = self._notes.arrays(now if sounding_until is None else sounding_until)
        touch = TOUCHES[self._player.touch]
        pedal = self._pedal
        if self._works_pedal:
            edges = np.flatnonzero(np.diff(np.pad(np.array(self._pedalled, np.int8), 1)))
            pedal = edges.reshape(-1, 2) / FRAME_RATE
        return Score(
            key=made["event_key"],
            onset=made["event_on"],
            offset=made["event_off"],
            velocity=touch.velocity_of(made["event_speed"], made["event_key"]),
            pedal=pedal,
            title=self._score.title,
        )


def _gain(score: Score) -> float:
    """By how much sound is to be multiplied, judged by the beginning of what is asked for."""
    loudest = float(np.abs(live_sound(score, 0.0, min(score.duration, _MEASURED_SECONDS))).max())
    return _HEADROOM * PEAK / loudest if loudest else 1.0


def _from(score: Score, first: int) -> Score:
    return Score(
        score.key[first:], score.onset[first:], score.offset[first:], score.velocity[first:]
    )

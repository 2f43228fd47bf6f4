"""Players: a name, and what starts a Controller for a Score."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pianomime.keyboard import FRAME_RATE, FRAME_SECONDS, KEYS
from pianomime.music import Score
from pianomime.plan import Planner
from pianomime.players.performance import Performance
from pianomime.players.rollout import Step, rollout
from pianomime.players.sounding_notes import SoundingNotes
from pianomime.progress import Progress, no_progress, telling
from pianomime.short_repr import short_repr
from pianomime.track import Controller, PedalController, Tracker
from pianomime.world import World
from pianomime.world.layout import LAYOUT
from pianomime.world.touch import DEFAULT_TOUCH
from pianomime.world_names import PAPER


class Observer(Protocol):
    """Looks on while a score is played, as the stage does."""

    def planned(self, controller: Controller) -> None:
        """See who will play, and by what plan."""

    def watch(self, world: World) -> None:
        """See the world after a physics step."""

    def played(self, step: Step) -> None:
        """See what was done in a frame, after its last physics step."""


class Player(ABC):
    """Plays scores.

    A player of one's own needs `name` and `start`; often a `PlannedPlayer` will do.

    Attributes:
        name: what reports call it.
        effort: how hard it tries, 0 to 3; 0 for a player that does not search.
        excerpt: start and length [s] of the only excerpt that it can play, as an expert of one
            song; None for a player of any.
        touch: name of the map from the speed of a key to MIDI velocity, as in
            `pianomime.world.touch.TOUCHES`.
        world: name of the world in which it plays, one of `pianomime.world_names.WORLDS`.
    """

    name: str
    effort: int = 0
    excerpt: tuple[float, float] | None = None
    touch: str = DEFAULT_TOUCH
    world: str = PAPER

    @abstractmethod
    def start(self, score: Score) -> Controller:
        """A controller that plays a score, from the rest pose.

        Args:
            score: what to play, all of it.

        Raises:
            InputError: this player cannot play this score.
        """

    def play(
        self,
        score: Score,
        progress: Progress = no_progress,
        observer: Observer | None = None,
    ) -> Performance:
        """Perform a score in a new World, of the name that it plays in.

        Args:
            score: what to play; all of it is played (see `pianomime.excerpt`).
            progress: called with the phase "planning", then with those that the planner and the
                tracker tell (see `pianomime.progress.tell`), and with "playing".
            observer: is told what happens while it happens; it changes nothing.

        Returns:
            What happened. Its `plan_seconds` is the time that `start` took; a player that plans
            while it plays spends that time in `simulate_seconds`.

        Raises:
            InputError: this player cannot play this score.
        """
        progress("planning", 0, 0)
        began = time.perf_counter()
        with telling(progress):
            controller = self.start(score)
        planned = time.perf_counter()
        if observer is not None:
            observer.planned(controller)

        frames = score.frames()
        ctrl = []
        qpos = np.empty((frames, LAYOUT.qpos_size))
        key_state = np.empty((frames, KEYS))
        pressed = np.empty((frames, KEYS), bool)
        pedal = np.empty(frames, bool)
        blow_ups = np.zeros(frames, np.int64)
        world, notes = World(self.world), SoundingNotes()
        watch = None if observer is None else partial(observer.watch, world)
        for step in rollout(controller, world, score.pedal_roll(), watch):
            frame = step.frame
            ctrl.append(np.atleast_2d(step.ctrl))
            pedal[frame] = step.pedal
            notes.add(step.key_events, frame * FRAME_SECONDS)
            qpos[frame], key_state[frame] = world.qpos, world.key_state
            pressed[frame] = world.pressed
            blow_ups[frame] = world.blow_ups
            if observer is not None:
                observer.played(step)
            progress("playing", frame + 1, frames)
        works_pedal = isinstance(controller, PedalController)
        return Performance(
            score=score,
            player=self.name,
            effort=self.effort,
            touch=self.touch,
            world=self.world,
            works_pedal=works_pedal,
            plan=controller.plan,
            ctrl=np.array(ctrl),
            qpos=qpos,
            key_state=key_state,
            pressed=pressed,
            pedal=pedal,
            pedal_times=_intervals(pedal) if works_pedal else score.pedal,
            **notes.arrays(frames * FRAME_SECONDS),
            blow_ups=np.flatnonzero(np.diff(blow_ups, prepend=0)),
            plan_seconds=planned - began,
            simulate_seconds=time.perf_counter() - planned,
        )


def _intervals(pedal: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(P, 2) When the pedal is down [s], of its frames (T,)."""
    edges = np.flatnonzero(np.diff(np.pad(pedal, 1).astype(np.int8)))
    return edges.reshape(-1, 2) / FRAME_RATE


@dataclass(frozen=True)
class PlannedPlayer(Player):
    """A planner decides where the fingertips go, a tracker gets them there.

    Attributes:
        name: what reports call it.
        planner: makes a FingertipPlan of a Score.
        tracker: makes a Controller of the plan, for the same world.
        effort: how hard it tries, 0 to 3.
        excerpt, touch, world: see `Player`.
    """

    name: str
    planner: Planner
    tracker: Tracker
    effort: int = 0
    excerpt: tuple[float, float] | None = None
    touch: str = DEFAULT_TOUCH
    world: str = PAPER

    def __repr__(self) -> str:
        return short_repr(self, repr(self.name), f"effort {self.effort}")

    def start(self, score: Score) -> Controller:
        """Plan the whole score, then start the tracker."""
        return self.tracker.start(self.planner.plan(score))

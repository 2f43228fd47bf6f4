"""Player: a planner and a tracker that together perform a score in the World."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pianomime.errors import InputError
from pianomime.music import Score
from pianomime.plan import Planner, ZeroShotPlanner
from pianomime.plan.demonstration import Demonstration, DemonstrationPlanner
from pianomime.players.performance import Performance
from pianomime.policies.methods import FINGERS, METHODS, make_fingers, make_generalist
from pianomime.track import (
    DynamicTracker,
    IkTracker,
    PedalTracker,
    PredictiveSamplingConfig,
    PredictiveSamplingTracker,
    Tracker,
)
from pianomime.world import World

Progress = Callable[[str, int, int], None]
"""Called with a stage ("planning", "playing"), the steps done and the steps in all (0: unknown)."""

EFFORT = 1
"""How hard players try unless told otherwise, 0 to 3."""


def check_player(name: str, effort: int) -> None:
    """Refuse what `Player.from_name` would, without making a player.

    Args:
        name: one of `PLAYERS`.
        effort: 0 to 3.

    Raises:
        InputError: there is no such player, or no such effort; the message lists those there are.
    """
    if effort not in range(4):
        raise InputError(f"effort must be 0, 1, 2 or 3, not {effort}")
    if name in DEMONSTRATION_PLAYERS:
        raise InputError(f"the player {name!r} plays demonstrations (.npz), not MIDI files")
    if name not in PLAYERS:
        raise InputError(f"there is no player {name!r}; there are: {', '.join(PLAYERS)}")


@dataclass(frozen=True)
class Player:
    """Plays scores: the planner decides where the fingertips go, the tracker gets them there.

    Attributes:
        name: what reports call it.
        planner: makes a FingertipPlan of a Score.
        tracker: makes controls of the plan and the state of the World.
        effort: how hard it tries, 0 to 3; 0 for one that does not search.
    """

    name: str
    planner: Planner
    tracker: Tracker
    effort: int = 0

    @classmethod
    def from_name(cls, name: str, effort: int = EFFORT, seed: int = 0) -> Player:
        """A player that the house knows.

        Args:
            name: one of `PLAYERS`.
            effort: 0 plays straight away; 1 to 3 try variations of what goes wrong before it
                is played, ever more of them. Players that imitate run a diffusion in ever more
                steps. All others are always the same.
            seed: of what it draws.

        Raises:
            InputError: there is no such player, or no such effort; the message lists those
                there are.
        """
        check_player(name, effort)
        return PLAYERS[name](effort, seed)

    @classmethod
    def from_demonstration(
        cls, demonstration: Demonstration, name: str = "", effort: int = EFFORT
    ) -> Player:
        """A player that plays one score with the fingertips of the human who demonstrated it.

        Args:
            demonstration: whose score it plays.
            name: one of `DEMONSTRATION_PLAYERS`; the first if not given.
            effort: 0 to 3, see `from_name`.

        Raises:
            InputError: there is no such player, or no such effort; the message lists those
                there are.
        """
        if effort not in range(4):
            raise InputError(f"effort must be 0, 1, 2 or 3, not {effort}")
        name = name or next(iter(DEMONSTRATION_PLAYERS))
        if name not in DEMONSTRATION_PLAYERS:
            there = ", ".join([*DEMONSTRATION_PLAYERS, *PLAYERS])
            raise InputError(f"there is no player {name!r} of demonstrations; there are: {there}")
        tracker = DEMONSTRATION_PLAYERS[name](effort)
        tries = effort if isinstance(tracker, PredictiveSamplingTracker) else 0
        return cls(name, DemonstrationPlanner(demonstration), tracker, tries)

    def play(self, score: Score, progress: Progress | None = None) -> Performance:
        """Perform a score from the rest pose; the same score gives the same performance.

        Args:
            score: what to play; all of it is played (see `excerpt`).
            progress: told how far it is.
        """
        tell = progress or (lambda stage, done, total: None)
        tell("planning", 0, 0)
        began = time.perf_counter()
        plan = self.planner.plan(score)
        planned = time.perf_counter()

        frames = score.frames()
        pedal = score.pedal_roll()
        ctrl = np.empty((frames, 46))
        qpos = np.empty((frames, 142))
        key_state = np.empty((frames, 88))
        pressed = np.empty((frames, 88), bool)
        blow_ups = []
        world = World()
        self.tracker.begin(plan)
        pedal_tracker = self.tracker if isinstance(self.tracker, PedalTracker) else None
        for frame in range(frames):
            broken = world.blow_ups
            ctrl[frame] = self.tracker.control(frame, world)
            if pedal_tracker is not None:
                pedal[frame] = pedal_tracker.pedal(frame)
            world.step(ctrl[frame], pedal=bool(pedal[frame]))
            qpos[frame], key_state[frame] = world.qpos, world.key_state
            pressed[frame] = world.pressed
            if world.blow_ups > broken:
                blow_ups.append(frame)
            tell("playing", frame + 1, frames)
        return Performance(
            score=score,
            player=self.name,
            effort=self.effort,
            plan=plan,
            ctrl=ctrl,
            qpos=qpos,
            key_state=key_state,
            pressed=pressed,
            pedal=pedal,
            blow_ups=np.array(blow_ups, np.int64),
            plan_seconds=planned - began,
            simulate_seconds=time.perf_counter() - planned,
        )


def _zero_shot(effort: int, seed: int) -> Player:
    tracker = _searching(DynamicTracker(), effort, seed)
    return Player("zero-shot", ZeroShotPlanner(), tracker, effort)


def _zero_shot_ik(_: int, __: int) -> Player:
    return Player("zero-shot-ik", ZeroShotPlanner(), IkTracker())


def _fingers(effort: int, seed: int) -> Player:
    tracker = _searching(make_fingers(), effort, seed)
    return Player(FINGERS, ZeroShotPlanner(), tracker, effort)


def _generalist(method: str) -> Callable[[int, int], Player]:
    def make(effort: int, seed: int) -> Player:
        both = make_generalist(method, effort, seed)
        return Player(method, both, both, effort)

    return make


PLAYERS: dict[str, Callable[[int, int], Player]] = {
    "zero-shot": _zero_shot,
    "zero-shot-ik": _zero_shot_ik,
    FINGERS: _fingers,
    **{method: _generalist(method) for method in METHODS},
}
"""Every player by name, given the effort and the seed of what it draws.

A new one is one more line; what others need not wait for, such as learned weights, it imports and
loads inside its function.
"""


def _searching(tracker: Tracker, effort: int, seed: int = 0) -> Tracker:
    if not effort:
        return tracker
    return PredictiveSamplingTracker(
        tracker, replace(PredictiveSamplingConfig.of_effort(effort), seed=seed)
    )


def _dynamic(effort: int) -> Tracker:
    return _searching(DynamicTracker(), effort)


def _plain_ik(_: int) -> Tracker:
    return IkTracker()


DEMONSTRATION_PLAYERS: dict[str, Callable[[int], Tracker]] = {
    "demonstration": _dynamic,
    "demonstration-ik": _plain_ik,
}
"""The tracker of every player of demonstrations, by the player's name, given the effort."""

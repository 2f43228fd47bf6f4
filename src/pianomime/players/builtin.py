"""The players that come with the program."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.plan import ZeroShotConfig, ZeroShotPlanner
from pianomime.plan.demonstration import (
    Demonstration,
    DemonstrationConfig,
    DemonstrationPlanner,
)
from pianomime.plan.fingering_cost import FingeringConfig
from pianomime.players.generalist import GeneralistPlayer, PredictionConfig, ThreeStagePlayer
from pianomime.players.player import PlannedPlayer, Player
from pianomime.players.receding_horizon import HorizonConfig, RecedingHorizonPlayer
from pianomime.players.settings import PlayerFactory, configure
from pianomime.policies.methods import (
    FINGERS,
    GENERALISTS,
    SAMPLERS,
    THREE_STAGE,
    load_finger_tracker,
    load_policy_tracker,
    load_stages,
    weight_files,
)
from pianomime.policies.network_file import load_policy
from pianomime.track import (
    DynamicConfig,
    DynamicTracker,
    IkConfig,
    IkTracker,
    KeystrokeConfig,
    KeystrokeTracker,
    NoteSamplingConfig,
    NoteSamplingTracker,
    PredictiveSamplingConfig,
    PredictiveSamplingTracker,
    RehearsalConfig,
    RehearsedTracker,
    Tracker,
)
from pianomime.world_names import PAPER

ZERO_SHOT_20HZ = "zero-shot-20hz"
"""The zero-shot player of frames, in the paper's protocol: one control a frame, notes begin and end
with frames, and frames are what counts. Learners build on it."""


_APART = 0.002
"""[m] Distance that fingers and hands keep in plans for hands that do not pass through each other:
contacts begin at 1 mm."""


class DemonstrationNeededError(InputError):
    """The player plays demonstrations alone, and none was given."""


def _with_sampling(
    tracker: Tracker, effort: int, sampling: PredictiveSamplingConfig, world: str
) -> Tracker:
    return PredictiveSamplingTracker(tracker, sampling, world=world) if effort else tracker


def _budget(effort: int, seed: int) -> PredictiveSamplingConfig:
    return replace(PredictiveSamplingConfig.of_effort(effort or 1), seed=seed)


def _notes(world: str) -> tuple[ZeroShotConfig, KeystrokeConfig]:
    """How to plan and strike notes in a world."""
    planner, tracker = ZeroShotConfig(fingering=FingeringConfig.notes()), KeystrokeConfig()
    if world == PAPER:
        return planner, tracker
    path = replace(planner.path, path=replace(planner.path.path, apart=_APART))
    return (
        replace(planner, fingering=FingeringConfig.solid_notes(), path=path),
        replace(tracker, path=replace(tracker.path, apart=_APART)),
    )


def _zero_shot(effort: int, seed: int, world: str = PAPER, **settings: Any) -> Player:
    planning, keystrokes = _notes(world)
    planner, tracker, horizon, rehearsal, sampling = configure(
        settings,
        planner=planning,
        tracker=keystrokes,
        horizon=HorizonConfig(),
        rehearsal=RehearsalConfig(),
        sampling=replace(NoteSamplingConfig.of_effort(effort or 1), seed=seed),
    )
    striking, name, touch = KeystrokeTracker(tracker, world), "zero-shot", tracker.stroke.touch
    if not effort:
        return RecedingHorizonPlayer(
            name, ZeroShotPlanner(planner), striking, touch=touch, world=world, horizon=horizon
        )
    controls = NoteSamplingTracker(RehearsedTracker(striking, rehearsal), sampling)
    return PlannedPlayer(name, ZeroShotPlanner(planner), controls, effort, touch=touch, world=world)


def _zero_shot_20hz(effort: int, seed: int, world: str = PAPER, **settings: Any) -> Player:
    planner, tracker, sampling = configure(
        settings,
        planner=ZeroShotConfig(),
        tracker=DynamicConfig(),
        sampling=_budget(effort, seed),
    )
    controls = _with_sampling(DynamicTracker(tracker, world), effort, sampling, world)
    return PlannedPlayer(ZERO_SHOT_20HZ, ZeroShotPlanner(planner), controls, effort, world=world)


def _zero_shot_ik(effort: int, seed: int, world: str = PAPER, **settings: Any) -> Player:
    planner, tracker = configure(settings, planner=ZeroShotConfig(), tracker=IkConfig())
    return PlannedPlayer("zero-shot-ik", ZeroShotPlanner(planner), IkTracker(tracker), world=world)


def _fingers(
    effort: int,
    seed: int,
    weights: str | Path | None = None,
    world: str = PAPER,
    **settings: Any,
) -> Player:
    planner, sampling = configure(
        settings, planner=ZeroShotConfig(), sampling=_budget(effort, seed)
    )
    controls = _with_sampling(load_finger_tracker(weights, world), effort, sampling, world)
    return PlannedPlayer(FINGERS, ZeroShotPlanner(planner), controls, effort, world=world)


def _three_stage(
    effort: int,
    seed: int,
    weights: str | Path | None = None,
    world: str = PAPER,
    **settings: Any,
) -> Player:
    configure(settings)
    return ThreeStagePlayer(THREE_STAGE, load_stages(weights), effort, world)


def _demonstration(
    effort: int,
    seed: int,
    demonstration: Demonstration | str | Path = "",
    world: str = PAPER,
    **settings: Any,
) -> Player:
    planning, tracker, sampling = configure(
        settings,
        planner=DemonstrationConfig(),
        tracker=DynamicConfig(),
        sampling=_budget(effort, seed),
    )
    planner = replace(_demonstration_planner(demonstration), config=planning)
    controls = _with_sampling(DynamicTracker(tracker, world), effort, sampling, world)
    return PlannedPlayer("demonstration", planner, controls, effort, world=world)


def _demonstration_ik(
    effort: int,
    seed: int,
    demonstration: Demonstration | str | Path = "",
    world: str = PAPER,
    **settings: Any,
) -> Player:
    (tracker,) = configure(settings, tracker=IkConfig())
    planner = _demonstration_planner(demonstration)
    return PlannedPlayer("demonstration-ik", planner, IkTracker(tracker), world=world)


def _demonstration_planner(demonstration: Demonstration | str | Path) -> DemonstrationPlanner:
    if not demonstration:
        raise DemonstrationNeededError("this player plays demonstrations (.npz), not MIDI files")
    if not isinstance(demonstration, Demonstration):
        demonstration = Demonstration.load(demonstration)
    return DemonstrationPlanner(demonstration)


def _generalist(method: str) -> PlayerFactory:
    def make(
        effort: int,
        seed: int,
        weights: str | Path | None = None,
        world: str = PAPER,
        **settings: Any,
    ) -> Player:
        configs = _generalist_configs(method, effort)
        sampler, *prediction = configure(settings, **configs)
        *high, low = zip(GENERALISTS[method], weight_files(method, weights), strict=True)
        tracker = load_policy_tracker(low[1], sampler, seed, low[0])
        fingertips = load_policy(high[0][1], sampler, high[0][0]) if high else None
        player = GeneralistPlayer(method, tracker, fingertips, seed, effort, world=world)
        return replace(player, prediction=prediction[0]) if prediction else player

    return make


def _generalist_configs(method: str, effort: int) -> dict[str, Any]:
    """The configs of a generalist by group: only one of two stages predicts fingertips."""
    sampler = {"sampler": SAMPLERS[effort]}
    two_stages = len(GENERALISTS[method]) == 2
    return {**sampler, "planner": PredictionConfig()} if two_stages else sampler


FACTORIES: dict[str, PlayerFactory] = {
    "zero-shot": _zero_shot,
    ZERO_SHOT_20HZ: _zero_shot_20hz,
    "zero-shot-ik": _zero_shot_ik,
    FINGERS: _fingers,
    THREE_STAGE: _three_stage,
    **{method: _generalist(method) for method in GENERALISTS},
    "demonstration": _demonstration,
    "demonstration-ik": _demonstration_ik,
}
"""What makes each player, by name."""

_SAMPLING = {"sampling": PredictiveSamplingConfig.of_effort(1)}
SETTINGS: dict[str, dict[str, Any]] = {
    "zero-shot": {
        "planner": ZeroShotConfig(fingering=FingeringConfig.notes()),
        "tracker": KeystrokeConfig(),
        "horizon": HorizonConfig(),
        "rehearsal": RehearsalConfig(),
        "sampling": NoteSamplingConfig.of_effort(1),
    },
    ZERO_SHOT_20HZ: {"planner": ZeroShotConfig(), "tracker": DynamicConfig(), **_SAMPLING},
    "zero-shot-ik": {"planner": ZeroShotConfig(), "tracker": IkConfig()},
    FINGERS: {"planner": ZeroShotConfig(), **_SAMPLING},
    **{method: _generalist_configs(method, 1) for method in GENERALISTS},
    "demonstration": {"planner": DemonstrationConfig(), "tracker": DynamicConfig(), **_SAMPLING},
    "demonstration-ik": {"tracker": IkConfig()},
}
"""The configs whose fields are the settings of each player, by group, at effort 1 in the paper's
world."""


def configs_of(name: str, world: str) -> dict[str, Any]:
    """The configs whose fields are the settings of a player, by group, at effort 1.

    Args:
        name: of the player; one that does not come with the program has none.
        world: name of the world in which it plays.
    """
    configs = SETTINGS.get(name, {})
    if name != "zero-shot":
        return configs
    planner, tracker = _notes(world)
    return {**configs, "planner": planner, "tracker": tracker}

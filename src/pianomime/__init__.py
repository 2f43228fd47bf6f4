"""PianoMime: give it a song, and two simulated robot hands play it."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pianomime import songs
    from pianomime.errors import InputError
    from pianomime.evaluation.diagnose import diagnose
    from pianomime.evaluation.evaluation import evaluate
    from pianomime.music import Score, excerpt
    from pianomime.plan import FingertipPlan, Planner
    from pianomime.plan.demonstration import Demonstration
    from pianomime.players import (
        Performance,
        PlannedPlayer,
        Player,
        load_player,
        player_names,
        register_player,
        rollout,
    )
    from pianomime.track import Controller, Tracker
    from pianomime.video.retarget import retarget
    from pianomime.world import World, WorldBatch

__version__ = "0.1.0"

# Imported on first use, so that `pianomime --help` does not wait for the physics.
_EXPORTS = {
    "Controller": "pianomime.track",
    "Demonstration": "pianomime.plan.demonstration",
    "FingertipPlan": "pianomime.plan",
    "InputError": "pianomime.errors",
    "Performance": "pianomime.players",
    "PlannedPlayer": "pianomime.players",
    "Planner": "pianomime.plan",
    "Player": "pianomime.players",
    "Score": "pianomime.music",
    "Tracker": "pianomime.track",
    "World": "pianomime.world",
    "WorldBatch": "pianomime.world",
    "diagnose": "pianomime.evaluation.diagnose",
    "evaluate": "pianomime.evaluation.evaluation",
    "excerpt": "pianomime.music",
    "load_player": "pianomime.players",
    "player_names": "pianomime.players",
    "register_player": "pianomime.players",
    "retarget": "pianomime.video.retarget",
    "rollout": "pianomime.players",
}

__all__ = [
    "Controller",
    "Demonstration",
    "FingertipPlan",
    "InputError",
    "Performance",
    "PlannedPlayer",
    "Planner",
    "Player",
    "Score",
    "Tracker",
    "World",
    "WorldBatch",
    "__version__",
    "diagnose",
    "evaluate",
    "excerpt",
    "load_player",
    "player_names",
    "register_player",
    "retarget",
    "rollout",
    "songs",
]


def __getattr__(name: str) -> Any:
    if name == "songs":
        return importlib.import_module("pianomime.songs")
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_EXPORTS[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)

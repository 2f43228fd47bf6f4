"""PianoMime: give it a song, and two simulated robot hands play it."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pianomime.evaluation.evaluation import evaluate
    from pianomime.music import Score
    from pianomime.music.excerpt import excerpt
    from pianomime.players.performance import Performance
    from pianomime.players.player import Player

__version__ = "0.1.0"

__all__ = ["Performance", "Player", "Score", "__version__", "evaluate", "excerpt"]

# Imported on first use, so that `pianomime --help` does not wait for the physics.
_EXPORTS = {
    "Performance": "pianomime.players.performance",
    "Player": "pianomime.players.player",
    "Score": "pianomime.music",
    "evaluate": "pianomime.evaluation.evaluation",
    "excerpt": "pianomime.music",
}


def __getattr__(name: str) -> Any:
    if name not in _EXPORTS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_EXPORTS[name]), name)

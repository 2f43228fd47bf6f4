"""Players: what performs a Score in the World, and the Performance that it leaves."""

from pianomime.players.performance import Performance
from pianomime.players.player import PlannedPlayer, Player
from pianomime.players.registry import load_player, player_names, register_player
from pianomime.players.rollout import rollout

__all__ = [
    "Performance",
    "PlannedPlayer",
    "Player",
    "load_player",
    "player_names",
    "register_player",
    "rollout",
]

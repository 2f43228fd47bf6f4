"""`pianomime players`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Players:
    """List the players, those of other packages included, or the settings of one.

    A setting is an option of `pianomime play` and `pianomime evaluate`; its value is shown as it is
    at the default effort.

    Examples:
      pianomime players
      pianomime players zero-shot
      pianomime play SONG.mid --planner.beam 200 --tracker.force 6
    """

    player: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="[PLAYER]")] = ""
    """Whose settings to list."""

    def run(self) -> None:
        """Print one name a line, with the value that a setting has unless told otherwise.

        Raises:
            InputError: there is no such player.
        """
        import json

        from pianomime.players.registry import player_names, player_settings

        if not self.player:
            print("\n".join(player_names()))
            return
        settings = player_settings(self.player)
        for name, value in settings.items():
            print(f"--{name.replace('_', '-')} {json.dumps(value)}")
        if not settings:
            print(f"{self.player} has no settings")

"""Who plays a file, and what of it: of a MIDI file or of a demonstration, whose plan some need."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.music import Score
from pianomime.music.excerpt import check_lead_in, excerpt
from pianomime.plan.demonstration import Demonstration, DemonstrationPlanner
from pianomime.players.builtin import DemonstrationNeededError
from pianomime.players.performance import is_performance
from pianomime.players.player import PlannedPlayer, Player
from pianomime.players.registry import load_player
from pianomime.shown import command_word

_SUFFIX = ".npz"
"""Of demonstrations; any other file is read as MIDI."""


@dataclass(frozen=True)
class Casting:
    """Finds the player and the score of files, one after the other.

    Attributes:
        source: as `load_player` takes it.
        effort: how hard it tries, 0 to 3.
        seed: of everything that is random.
        world: name of the world in which it plays; each player's own if None.
        settings: of the player, by name.
        player: who plays all files; None where each demonstration has a player of its own, which
            follows the demonstration's plan.
    """

    source: str | Path | Player
    effort: int
    seed: int
    world: str | None
    settings: dict[str, Any]
    player: Player | None

    @classmethod
    def of(
        cls,
        source: str | Path | Player,
        effort: int,
        seed: int,
        world: str | None = None,
        **settings: Any,
    ) -> Casting:
        """Load the player, where it is one for all files.

        Args:
            source: as `load_player` takes it.
            effort: how hard it tries, 0 to 3.
            seed: of everything that is random.
            world: name of the world in which it plays; each player's own if None.
            **settings: of the player.

        Raises:
            InputError: there is no such player, effort, world or setting, it does not play in that
                world, or its files cannot be used.
        """
        try:
            player = load_player(source, effort, seed, world, **settings)
        except DemonstrationNeededError:
            player = None
        return cls(source, effort, seed, world, settings, player)

    def can_play(self, path: Path) -> bool:
        """Whether the player plays files of this kind."""
        return self.player is not None or path.suffix == _SUFFIX

    def check_kind(self, path: Path) -> None:
        """Refuse a file of a kind that the player does not play.

        Args:
            path: its suffix decides.

        Raises:
            DemonstrationNeededError: it is no demonstration, and the player needs one.
        """
        if not self.can_play(path):
            raise DemonstrationNeededError(
                f"{path}: {self.source} plays demonstrations (.npz), not MIDI files"
            )

    @property
    def takes_lead_in(self) -> bool:
        """Whether the player can begin with silence: no expert can, and no demonstration's plan."""
        player = self.player
        if player is None or player.excerpt is not None:
            return False
        return not (
            isinstance(player, PlannedPlayer) and isinstance(player.planner, DemonstrationPlanner)
        )

    def check_lead_in(self, lead_in: float) -> None:
        """Refuse what is no lead-in, or is none for this player.

        Args:
            lead_in: silence before the first sound [s].

        Raises:
            InputError: it is out of range, or the player takes none.
        """
        check_lead_in(lead_in)
        if lead_in and not self.takes_lead_in:
            name = self.source.name if isinstance(self.source, Player) else self.source
            raise InputError(
                f"lead-in {lead_in:g}: {name} plays music of its own, from the first note on; "
                f"its lead-in is 0"
            )

    def cast(
        self, path: Path, start: float, seconds: float, lead_in: float
    ) -> tuple[Player, Score]:
        """Who plays a file, and what.

        Args:
            path: a MIDI file or a demonstration.
            start: where to begin: with the first sound at or after it [s].
            seconds: how much of it at most [s]. A player of one excerpt plays that instead.
            lead_in: silence before the first sound [s].

        Raises:
            OSError: the file cannot be read.
            InputError: it is of another kind, or damaged; nothing sounds in that part of it; the
                player needs a demonstration, or takes no lead-in.
        """
        self.check_lead_in(lead_in)
        if self.player is not None and self.player.excerpt is not None:
            start, seconds = self.player.excerpt
        self.check_kind(path)
        if path.suffix != _SUFFIX:
            assert self.player is not None
            return self.player, excerpt(Score.from_midi(path), start, seconds, lead_in)
        if is_performance(path):
            raise InputError(
                f"{path}: is a performance, which was played already; see and hear it with "
                f"`pianomime report {command_word(path)}`"
            )
        shown = Demonstration.load(path).excerpt(start, seconds)
        if self.player is not None:
            return self.player, shown.score.delay(lead_in)
        made = load_player(
            self.source,
            self.effort,
            self.seed,
            self.world,
            demonstration=shown,
            **self.settings,
        )
        return made, shown.score

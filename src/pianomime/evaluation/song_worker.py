"""What `evaluate` has its worker processes do: play a song, and score it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from pianomime.evaluation.diagnose import diagnose, frames_by_cause
from pianomime.evaluation.summary import summarize
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.players.player import Player
from pianomime.players.registry import load_player
from pianomime.shown import title_of

SONG_WORKER = "pianomime.evaluation.song_worker:load_song_worker"
"""`load_song_worker`, for `pianomime.workers`."""


def load_song_worker(setup: dict[str, Any]) -> Callable[[str], dict[str, Any]]:
    """Load a player, once for all songs of a process.

    Args:
        setup: `player`, `effort`, `seed` and `settings`, what `load_player` takes; `seconds`, how
            much of a song to play at most [s].

    Returns:
        What plays a MIDI file and gives its row, as `play_song` does.
    """
    player = load_player(setup["player"], setup["effort"], setup["seed"], **setup["settings"])
    return lambda path: play_song(player, Path(path), setup["seconds"])


def play_song(player: Player, song: Path, seconds: float) -> dict[str, Any]:
    """Play a song and score it.

    Args:
        player: who plays.
        song: a MIDI file.
        seconds: how much of it to play at most [s]; a player of one excerpt plays that.

    Returns:
        The row: the summary, with the name of the file as its `song`, and `causes`, the frames that
        each cause cost, if the player plans.

    Raises:
        InputError: the file cannot be read, or this player cannot play it.
    """
    start, length = player.excerpt or (0.0, seconds)
    performance = player.play(excerpt(Score.from_midi(song), start, length))
    # Two files can bear one title, but not one name in a folder.
    row: dict[str, Any] = {**summarize(performance), "song": title_of(song)}
    if performance.plan is not None:
        row["causes"] = frames_by_cause(diagnose(performance))
    return row

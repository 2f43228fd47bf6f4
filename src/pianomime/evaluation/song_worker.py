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

SONG_WORKER = "pianomime.evaluation.song_worker:load_song_worker"
"""`load_song_worker`, for `pianomime.workers`."""


def load_song_worker(setup: dict[str, Any]) -> Callable[[str], dict[str, Any]]:
    """Load a player, once for all songs of a process.

    Args:
        setup: `player`, `effort` and `seed`, what is to be loaded; `seconds`, how much of a song to
            play at most [s].

    Returns:
        What plays a MIDI file and gives its row: the summary, with the name of the file as its
        `song`, and `causes`, the frames that each cause cost, if the player plans.
    """
    player = Player.from_name(setup["player"], setup["effort"], setup["seed"])

    def play(path: str) -> dict[str, Any]:
        song = Path(path)
        score = excerpt(Score.from_midi(song), seconds=setup["seconds"])
        performance = player.play(score)
        # Two files can bear one title, but not one name in a folder.
        row: dict[str, Any] = {**summarize(performance), "song": song.stem}
        if performance.plan is not None:
            row["causes"] = frames_by_cause(diagnose(performance))
        return row

    return play

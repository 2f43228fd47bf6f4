"""What `evaluate` has its worker processes do: play a song, and score it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from pianomime.evaluation.diagnose import diagnose, frames_by_cause
from pianomime.evaluation.summary import summarize
from pianomime.players.casting import Casting
from pianomime.shown import title_of

SONG_WORKER = "pianomime.evaluation.song_worker:load_song_worker"
"""`load_song_worker`, for `pianomime.workers`."""


def load_song_worker(setup: dict[str, Any]) -> Callable[[dict[str, str]], dict[str, Any]]:
    """Load a player, once for all songs of a process.

    Args:
        setup: `player`, `effort`, `seed`, `world` and `settings`, what `load_player` takes;
            `seconds`, how much of a song to play at most, and `lead_in`, the silence before it [s].

    Returns:
        What plays the song of a `song_request` and gives its row, as `play_song` does.
    """
    casting = Casting.of(
        setup["player"], setup["effort"], setup["seed"], setup["world"], **setup["settings"]
    )
    return lambda request: play_song(casting, request, setup["seconds"], setup["lead_in"])


def song_request(song: Path, performance: Path | None) -> dict[str, str]:
    """What a worker is asked, for JSON.

    Args:
        song: a MIDI file or a demonstration.
        performance: where to keep its performance; None for nowhere.
    """
    kept = {} if performance is None else {"performance": str(performance)}
    return {"song": str(song), **kept}


def play_song(
    casting: Casting, request: dict[str, str], seconds: float, lead_in: float
) -> dict[str, Any]:
    """Play a song and score it.

    Args:
        casting: who plays.
        request: a `song_request`.
        seconds: how much of it to play at most [s]; a player of one excerpt plays that.
        lead_in: silence before the first sound [s].

    Returns:
        The row: the summary, with the name of the file as its `song`, and `causes`, the frames that
        each cause cost, if the player plans; or `unwritable`, the reason why the performance cannot
        be kept.

    Raises:
        InputError: the file cannot be read, or this player cannot play it.
        OSError: the file cannot be read.
    """
    song = Path(request["song"])
    player, score = casting.cast(song, 0.0, seconds, lead_in)
    performance = player.play(score)
    if "performance" in request:
        try:
            performance.save(request["performance"])
        except OSError as error:
            # No fault of the song: the next one could not be kept either.
            return {"unwritable": error.strerror or str(error)}
    # Two files can bear one title, but not one name in a folder.
    row: dict[str, Any] = {**summarize(performance), "song": title_of(song)}
    if performance.plan is not None:
        row["causes"] = frames_by_cause(diagnose(performance))
    return row

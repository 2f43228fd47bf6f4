"""What `perform` has its worker processes do: play a song, and keep the episode in a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pianomime import __version__
from pianomime.errors import InputError
from pianomime.learn.data.dagger_config import DaggerConfig
from pianomime.learn.data.episode import (
    Episode,
    Source,
    base_controls,
    fill_columns,
    record,
    song_number,
)
from pianomime.learn.data.noisy_controller import NoisyController, noise_spread
from pianomime.learn.data.parts import save_part
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.players.casting import Casting
from pianomime.players.player import Player
from pianomime.shown import title_of
from pianomime.track import IkTracker
from pianomime.workers import Answer, Row

PERFORM_WORKER = "pianomime.learn.data.perform_worker:load_perform_worker"
"""`load_perform_worker`, for `pianomime.workers`."""


@dataclass(frozen=True)
class Task:
    """What is asked of a worker, for JSON.

    Attributes:
        song: a MIDI file.
        digest: SHA-256 of that file, in hexadecimal digits.
        part: where to keep the episode.
        split: of the episode.
    """

    song: str
    digest: str
    part: str
    split: str


def load_perform_worker(setup: dict[str, Any]) -> Answer:
    """Load a player, once for all songs of a process.

    Args:
        setup: `player`, `effort`, `seed`, `world` and `settings`, what `load_player` takes;
            `seconds`, `lead_in` and `noise`, as of `perform`.

    Returns:
        What plays the song of a `Task`, given by its attributes, and keeps the episode. The row has
        its `frames` and `f1`, and `remarks`, what was mended or left out when the file was read;
        or `unwritable`, the reason why it cannot be kept.
    """
    casting = Casting.of(
        setup["player"], setup["effort"], setup["seed"], setup["world"], **setup["settings"]
    )
    assert casting.player is not None
    player, seconds, lead_in = casting.player, setup["seconds"], setup["lead_in"]
    noise, seed = setup["noise"], setup["seed"]

    def answer(request: dict[str, str]) -> Row:
        task = Task(**request)
        path = Path(task.song)
        whole = Score.from_midi(path)
        score = excerpt(whole, 0.0, seconds, lead_in)
        # Of the song alone, not of how many were played before it.
        rng = np.random.default_rng([seed, *bytes.fromhex(task.digest)])
        source = Source(title_of(path), task.digest, player.name, player.effort, seed, __version__)
        episode = play_as_episode(player, score, noise, rng, song_number(whole), task.split, source)
        try:
            save_part(Path(task.part), episode)
        except OSError as error:
            # No fault of the song: the next one could not be kept either.
            return {"unwritable": error.strerror or str(error)}
        frames = len(episode.columns["goal"])
        return {"frames": frames, "f1": episode.f1, "remarks": list(whole.remarks)}

    return answer


def play_as_episode(
    player: Player,
    score: Score,
    noise: float,
    rng: np.random.Generator,
    song_id: int,
    split: str,
    source: Source,
) -> Episode:
    """Have a player play a score, and record it as an episode.

    Args:
        player: who plays; it plans, and gives one control a frame.
        score: what to play, all of it.
        noise: largest standard deviation [rad] of the noise on the controls of fingers, of which
            the episode has a random share, as in `DaggerConfig`; 0 for none. With noise, `action`
            is what the player would send in each state, not what was sent.
        rng: of the noise.
        song_id: of the episode.
        split: of the episode.
        source: of the episode; its title names it.

    Raises:
        InputError: the player does not plan, gives several controls a frame, or cannot be asked
            what to do in any state, which noise needs; or the physics broke.
    """
    controller = player.start(score)
    if noise:
        spread = noise_spread(noise * rng.random())
        controller = NoisyController(controller, None, spread, DaggerConfig.noise_correlation, rng)
    columns, qpos, events = record(controller, score, player.world, player.touch)
    # Late: some plan while they play.
    plan = controller.plan
    if plan is None:
        raise InputError(f"{player.name} plans no fingertips, which a data set holds")
    if isinstance(controller, NoisyController):
        columns["action"][:] = controller.labels
    base = base_controls(IkTracker().start(plan), qpos)
    f1 = fill_columns(columns, base, score.roll(), plan.fingertips, plan.finger_key)
    return Episode(source.title, f1, "ik", columns, song_id, split, player.world, events, source)

"""A whole replay of a performance."""

from __future__ import annotations

import gzip
import os
from collections.abc import Iterator

from pianomime.evaluation.measures import BODY, FRAMES, MORE_MUSIC, MUSIC
from pianomime.evaluation.summary import Row
from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.players.performance import Performance
from pianomime.replay.blocks import json_block
from pianomime.replay.notes import Judgement, heard_block, notes_block, pedal_block
from pianomime.replay.poses import Poses
from pianomime.replay.scene import scene_block
from pianomime.shown import shown
from pianomime.world.layout import LAYOUT

_FORMAT, _VERSION = "pianomime-replay", 1
_EFFORT = 6
"""Of compression: more saves a hundredth and takes three times as long."""


def head_block(
    score: Score,
    player: str,
    effort: int,
    world: str,
    touch: str,
    rate: int,
) -> bytes:
    """The block that says what is played by whom.

    Args:
        score: what is to be played.
        player: name of the player.
        effort: how hard it tries, 0 to 3.
        world: name of the world in which it plays.
        touch: name of the map from the speed of a key to MIDI velocity.
        rate: poses per second.
    """
    return json_block(
        "HEAD",
        {
            "format": _FORMAT,
            "version": _VERSION,
            "title": score.title,
            "player": shown(player),
            "effort": effort,
            "world": world,
            "touch": touch,
            "seconds": score.frames() / FRAME_RATE,
            "rate": rate,
            "positions": LAYOUT.qpos_size,
            "remarks": list(score.remarks),
        },
    )


def done_block(row: Row) -> bytes:
    """The block that ends a performance.

    Args:
        row: its summary, of `pianomime.evaluation.summary.summarize`.
    """
    measures = (*MUSIC, *FRAMES, *MORE_MUSIC, *BODY)
    return json_block("DONE", {"metrics": [[each.label, each.show(row)] for each in measures]})


def replay_blocks(performance: Performance, row: Row, poses: Poses) -> Iterator[bytes]:
    """All blocks of the replay of a performance.

    Args:
        performance: what is to be shown.
        row: its summary, of `pianomime.evaluation.summary.summarize`.
        poses: of all of its frames.

    Yields:
        One block after the other, in the order in which a page can use them soonest.
    """
    score, judgement = performance.score, Judgement.of(performance)
    yield head_block(
        score,
        performance.player,
        performance.effort,
        performance.world,
        performance.touch,
        poses.rate,
    )
    yield scene_block()
    yield notes_block(score, performance.plan, judgement)
    yield heard_block(performance.played(), 0, judgement)
    yield pedal_block(performance.pedal_times)
    yield from poses.blocks()
    yield done_block(row)


def write_replay(
    path: str | os.PathLike[str], performance: Performance, row: Row, poses: Poses
) -> None:
    """Write the replay of a performance to a file, whole or not at all.

    Args:
        path: the file, NAME.replay.gz; its folder must exist.
        performance: what is to be shown.
        row: its summary, of `pianomime.evaluation.summary.summarize`.
        poses: of all of its frames.
    """
    with (
        atomic(path) as temporary,
        temporary.open("wb") as file,
        # Without a name and a time, the same performance gives the same bytes.
        gzip.GzipFile("", "wb", _EFFORT, file, mtime=0) as packed,
    ):
        for block in replay_blocks(performance, row, poses):
            packed.write(block)

"""What `train_experts` has worker processes and the nodes of a cluster do: train an expert."""

from __future__ import annotations

import errno
import json
import time
from pathlib import Path
from typing import Any

from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.expert.expert import train_expert
from pianomime.learn.runs.config_json import from_json, to_json
from pianomime.workers import Answer, Row

_FULL = (errno.ENOSPC, errno.EDQUOT)
"""Of errors that say that a disk, or a share of it, is full."""
EXPERT_WORKER = "pianomime.learn.expert.expert_worker:load_expert_worker"
"""`load_expert_worker`, for `pianomime.workers`."""


def expert_request(
    song: Path, out: Path, config: ExpertConfig, start: float, seconds: float
) -> dict[str, Any]:
    """What `train_one` is asked, for JSON.

    Args:
        song: a demonstration or a MIDI file.
        out: folder of its run.
        config: how.
        start: where the excerpt begins [s].
        seconds: its length at most [s].
    """
    request: dict[str, Any] = {
        "song": str(song),
        "out": str(out),
        "config": to_json(config),
        "start": start,
        "seconds": seconds,
    }
    # Lists for tuples, as where it passes through JSON: not every way to a node does.
    copied: dict[str, Any] = json.loads(json.dumps(request))
    return copied


def train_one(request: dict[str, Any]) -> Row:
    """Train an expert in this process, with one thread.

    Args:
        request: made by `expert_request`.

    Returns:
        `f1`, `precision` and `recall` of the best expert; `steps` of the run; `seconds` that this
        call took. Or `unwritable`, the reason why no run can be kept, of any song.

    Raises:
        InputError: the song, the config or what is in the folder cannot be used.
        OSError: a file cannot be read or written; what was there before stays.
    """
    began = time.perf_counter()
    try:
        run = train_expert(
            request["song"],
            Path(request["out"]),
            from_json(ExpertConfig, request["config"]),
            request["start"],
            request["seconds"],
            threads=1,
        )
    except OSError as error:
        if error.errno not in _FULL:
            raise
        return {"unwritable": error.strerror or str(error)}
    spent = {"steps": run.steps_done, "seconds": round(time.perf_counter() - began, 1)}
    return {**run.best()[1], **spent}


def load_expert_worker(setup: None) -> Answer:
    """`train_one`, which needs no setup."""
    return train_one

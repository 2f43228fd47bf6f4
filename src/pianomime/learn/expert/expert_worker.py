"""What `train_experts` has worker processes and the nodes of a cluster do: train an expert."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.expert.expert import train_expert
from pianomime.learn.runs.config_json import from_json, to_json
from pianomime.workers import Answer, Row

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
        call took.

    Raises:
        InputError: the song, the config or what is in the folder cannot be used.
        OSError: the folder cannot be written; what was there before stays.
    """
    began = time.perf_counter()
    run = train_expert(
        request["song"],
        Path(request["out"]),
        from_json(ExpertConfig, request["config"]),
        request["start"],
        request["seconds"],
        threads=1,
    )
    spent = {"steps": run.steps_done, "seconds": round(time.perf_counter() - began, 1)}
    return {**run.best()[1], **spent}


def load_expert_worker(setup: None) -> Answer:
    """`train_one`, which needs no setup."""
    return train_one

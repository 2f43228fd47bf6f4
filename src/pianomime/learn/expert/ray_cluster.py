"""One expert a task on a Ray cluster."""

from __future__ import annotations

import logging
import socket
from collections.abc import Generator
from typing import Any

import ray

from pianomime.errors import InputError
from pianomime.learn.expert.expert_worker import train_one
from pianomime.workers import Row, answered

_TRIES = 10
"""Times that a song is begun again when the node that it was on is lost."""


def on_cluster(
    requests: dict[str, dict[str, Any]], address: str
) -> Generator[tuple[str, Row], None, None]:
    """Rows in the order in which they are done.

    A song whose node dies is started again on another node and resumes from its checkpoint, so all
    nodes must see the folders of songs and runs.

    Args:
        requests: what to train, by name.
        address: of the cluster ("auto": the one that this machine is part of; "local": a new one
            on this machine).

    Raises:
        InputError: there is no such cluster.
    """
    ours = not ray.is_initialized()
    if ours:
        _reachable(address)
        try:
            ray.init(
                address=address,
                log_to_driver=False,
                logging_level=logging.ERROR,
                include_dashboard=False if address == "local" else None,
            )
        except (ConnectionError, ValueError, RuntimeError) as error:
            raise InputError(f"no Ray cluster at {address!r} ({error})") from error
    try:
        task = ray.remote(num_cpus=1, max_retries=_TRIES)(_train)
        waiting: dict[Any, str] = {task.remote(request): name for name, request in requests.items()}
        while waiting:
            done, _ = ray.wait(list(waiting), num_returns=1)
            name = waiting.pop(done[0])
            try:
                yield name, ray.get(done[0])
            except ray.exceptions.RayError as error:
                lines = str(error).splitlines() or [type(error).__name__]
                yield name, {"error": f"lost by the cluster: {lines[0]}"}
        waiting.clear()
    finally:
        if ours:
            ray.shutdown()


def _reachable(address: str) -> None:
    """Refuse at once an address where nobody listens; Ray would try for minutes."""
    host, _, port = address.rpartition(":")
    if not host or "://" in address or not port.isdigit():
        return
    try:
        socket.create_connection((host, int(port)), timeout=10).close()
    except (OSError, OverflowError) as error:
        raise InputError(f"no Ray cluster at {address!r} ({error})") from error


def _train(request: dict[str, Any]) -> Row:
    return answered(train_one, request)

"""The same work on a Ray cluster: what `pianomime.workers` does with the cores of one machine."""

from __future__ import annotations

import json
import logging
import socket
from collections.abc import Callable, Generator, Iterable
from functools import cache
from typing import Any, TypeVar

import ray

from pianomime.errors import InputError
from pianomime.workers import Answer, Row, answered, load_answer

_Item = TypeVar("_Item")

_TRIES = 10
"""Times that an item is begun again when the node that it was on is lost."""
_REACHABLE_SECONDS = 10
"""[s] in which a cluster has to take up a connection."""


def on_cluster(
    function: str,
    items: Iterable[_Item],
    address: str,
    setup: Any = None,
    request: Callable[[_Item], Any] = lambda item: item,
) -> Generator[tuple[_Item, Row], None, None]:
    """Items with their rows, in the order in which they are done, as `pianomime.workers.work`.

    Each item is a task of one core. One whose node dies is begun again on another node. All nodes
    must have this program, and see the files that requests name, under the same paths.

    Args:
        function: what loads what answers, as "package.module:function"; it is called once in each
            process of the cluster.
        items: what is to be done.
        address: of the cluster ("auto": the one that this machine is part of; "local": a new one
            on this machine).
        setup: what the function is given, for JSON.
        request: the request of an item, for JSON.

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
        task = ray.remote(num_cpus=1, max_retries=_TRIES)(_answer)
        given = json.dumps(setup)
        waiting: dict[Any, _Item] = {
            task.remote(function, given, json.dumps(request(item))): item for item in items
        }
        while waiting:
            done, _ = ray.wait(list(waiting), num_returns=1)
            item = waiting.pop(done[0])
            try:
                yield item, ray.get(done[0])
            except ray.exceptions.RayError as error:
                lines = str(error).splitlines() or [type(error).__name__]
                yield item, {"error": f"lost by the cluster: {lines[0]}"}
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
        socket.create_connection((host, int(port)), timeout=_REACHABLE_SECONDS).close()
    except (OSError, OverflowError) as error:
        raise InputError(f"no Ray cluster at {address!r} ({error})") from error


def _answer(function: str, setup: str, request: str) -> Row:
    """The row of a request, in a process of the cluster; both are JSON, as between processes."""
    return answered(_load_once(function, setup), json.loads(request))


@cache
def _load_once(function: str, setup: str) -> Answer:
    """What answers, loaded once for all tasks of a process."""
    return load_answer(function, json.loads(setup))

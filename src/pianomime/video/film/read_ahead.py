"""Read-ahead: items are made in another thread while earlier ones are in use."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")

_MOST = 4
"""Items that are made ahead."""
_END = object()
"""Marks the end of the items."""


def ahead(items: Iterator[_Item]) -> Iterator[_Item]:
    """The same items, made ahead in another thread.

    Args:
        items: iterator that makes them; an error that it raises is raised where the item is due.
    """
    with ThreadPoolExecutor(1) as maker:
        waiting = deque(maker.submit(next, items, _END) for _ in range(_MOST))
        while (item := waiting.popleft().result()) is not _END:
            waiting.append(maker.submit(next, items, _END))
            yield item  # type: ignore[misc]  # not the end, so an item

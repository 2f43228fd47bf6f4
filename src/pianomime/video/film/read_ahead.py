"""Making things ahead of their use, so that two cores have something to do."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

_Item = TypeVar("_Item")

_MOST = 4
"""Items that wait to be used."""
_END = object()


def ahead(items: Iterator[_Item]) -> Iterator[_Item]:
    """The same items, each made in another thread while those before are being used.

    Args:
        items: what makes them; an error that it raises is raised where the item is due.
    """
    with ThreadPoolExecutor(1) as maker:
        waiting = deque(maker.submit(next, items, _END) for _ in range(_MOST))
        while (item := waiting.popleft().result()) is not _END:
            waiting.append(maker.submit(next, items, _END))
            yield item  # type: ignore[misc]  # it is not the end, so it is an item

"""What has to be closed, and is at the end of a `with` block."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self


class Closing(ABC):
    """Has something open, such as a file or a process. Use it as a context manager."""

    @abstractmethod
    def close(self) -> None:
        """Close it; it is of no use then."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

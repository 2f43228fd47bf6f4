"""How training tells how far it is."""

from __future__ import annotations

from collections.abc import Callable

Tell = Callable[[int, int, str], None]
"""Called with the control steps spent, those in all, and a remark."""

"""The error for what a person gave and we cannot use."""

from __future__ import annotations


class InputError(ValueError):
    """What was asked for cannot be done as asked; the message is one line that says why."""

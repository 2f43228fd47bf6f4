"""Names of the cameras that look at the world; cheap to import."""

from __future__ import annotations

from typing import Literal, get_args

CameraName = Literal["player", "top", "side"]

CAMERAS: tuple[CameraName, ...] = get_args(CameraName)
"""Over the player's shoulders, from straight above, from the treble end."""

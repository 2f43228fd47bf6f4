"""What marks a data set of trajectories on disk. Cheap to import: no numpy, no zarr."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

FORMAT = "pianomime experts"
VERSION = 3


def is_data_set(path: Path) -> bool:
    """Whether a folder is a data set of trajectories, of any version, perhaps a damaged one."""
    attributes = zarr_attributes(path)
    return attributes is not None and attributes.get("format") == FORMAT


def zarr_attributes(path: Path) -> dict[str, Any] | None:
    """The attributes of a zarr 3 group; None if a folder is none."""
    try:
        attributes = json.loads((path / "zarr.json").read_text(encoding="utf-8"))["attributes"]
    except (OSError, ValueError, LookupError, TypeError):
        return None
    return attributes if isinstance(attributes, dict) else None

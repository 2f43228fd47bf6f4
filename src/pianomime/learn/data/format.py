"""What marks a data set of trajectories on disk. Cheap to import: no numpy, no zarr."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.sealed_json import read_json

ATTRIBUTES = "zarr.json"
"""File of the attributes, in the folder of the data set."""
FORMAT = "pianomime experts"
VERSION = 5
"""Of the data set; version 4 had no events."""
MOST_BYTES = 1024**3
"""Bytes of the attributes at most: those of half a million episodes."""


def is_data_set(path: Path) -> bool:
    """Whether a folder is a data set of trajectories, of any version, perhaps a damaged one."""
    attributes = zarr_attributes(path)
    return attributes is not None and attributes.get("format") == FORMAT


def why_no_data_set(path: Path) -> str:
    """Why `is_data_set` does not hold, for a message."""
    try:
        read_json(path / ATTRIBUTES, MOST_BYTES)
    except InputError as error:
        return f"damaged ({ATTRIBUTES}: {error})"
    except OSError:
        pass
    return "not a data set of trajectories"


def training_songs(path: Path) -> dict[int | str, str]:
    """Names of the songs in a data set, as far as it tells them, by what tells them apart."""
    episodes = (zarr_attributes(path) or {}).get("episodes")
    found: dict[int | str, str] = {}
    for one in episodes if isinstance(episodes, list) else ():
        if isinstance(one, dict) and one.get("split") == "train":
            name, number = str(one.get("name")), one.get("song_id")
            found[number if isinstance(number, int) and number >= 0 else name] = name
    return found


def zarr_attributes(path: Path) -> dict[str, Any] | None:
    """The attributes of a zarr 3 group; None if a folder is none."""
    try:
        attributes = read_json(path / ATTRIBUTES, MOST_BYTES)["attributes"]
    except (OSError, ValueError, LookupError, TypeError):
        return None
    return attributes if isinstance(attributes, dict) else None

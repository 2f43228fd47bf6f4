"""File of MediaPipe's hand model: given by the user, cached, or downloaded once."""

from __future__ import annotations

import hashlib
import os
import urllib.error
import urllib.request
from http.client import HTTPException
from pathlib import Path

from pianomime.errors import InputError
from pianomime.files import atomic

NAME = "hand_landmarker.task"
URL = (
    "https://storage.googleapis.com/mediapipe-models/hand_landmarker/hand_landmarker/float16/1/"
    + NAME
)
SHA256 = "fbc2a30080c3c557093b5ddfc334698132eb341044ccee322ccf8bcf3607cde1"
_TIMEOUT = 10.0
"""[s] Longest wait for the server."""
_LARGEST = 64 << 20
"""[bytes] No more is read from the server; the model has 8 MB."""


def find_hand_model(given: Path | None = None, url: str = URL) -> Path:
    """Find the file of MediaPipe's hand landmark model, or download it.

    Args:
        given: a file to use, whatever its version; None for the one in the cache, which is
            downloaded if it is not there, and verified by its checksum.
        url: address to download it from.

    Raises:
        InputError: the given file does not exist, or the download fails.
    """
    if given is not None:
        if not given.is_file():
            raise InputError(f"{given}: there is no such hand model file")
        return given
    cached = cache_folder() / NAME
    if cached.is_file() and _sha256(cached.read_bytes()) == SHA256:
        return cached
    try:
        with urllib.request.urlopen(url, timeout=_TIMEOUT) as answer:
            content: bytes = answer.read(_LARGEST)
    except (urllib.error.URLError, HTTPException, OSError, ValueError) as error:
        raise InputError(
            f"MediaPipe's hand model cannot be downloaded ({error}); get {url} on another machine "
            f"and name the file with --hand-model, or put it at {cached}"
        ) from error
    if _sha256(content) != SHA256:
        raise InputError(f"{url}: what was downloaded is not the hand model (wrong checksum)")
    cached.parent.mkdir(parents=True, exist_ok=True)
    with atomic(cached) as temporary:
        temporary.write_bytes(content)
    return cached


def cache_folder() -> Path:
    """Folder of downloaded files: PIANOMIME_CACHE if set, else a folder in the user's cache."""
    if "PIANOMIME_CACHE" in os.environ:
        return Path(os.environ["PIANOMIME_CACHE"])
    home = os.environ.get("LOCALAPPDATA" if os.name == "nt" else "XDG_CACHE_HOME")
    return Path(home or Path.home() / ".cache", "pianomime")


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()

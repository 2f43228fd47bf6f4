"""Opening of files of sound and video, which may come from anybody."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import av

from pianomime.errors import InputError


@contextmanager
def open_media(path: str | os.PathLike[str], wanted: str = "a video") -> Iterator[Any]:
    """Yields the open container of PyAV.

    Nothing but files is read, whatever the name looks like: FFmpeg would take a relative name such
    as "concat:x.mp4" for an address.

    Args:
        path: the file.
        wanted: what it should be, for the message.

    Raises:
        InputError: it does not exist, or is no video or sound.
    """
    try:
        container = av.open(os.path.abspath(path), options={"protocol_whitelist": "file"})
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist") from None
    except (av.error.FFmpegError, OSError, ValueError) as error:
        raise InputError(f"{path}: not {wanted}") from error
    with container:
        yield container


def pictures_of(container: Any) -> Any:
    """The stream of pictures of an open container; None if it has none.

    Args:
        container: as `open_media` yields it.
    """
    for stream in container.streams.video:
        # A cover picture is a video stream of one picture.
        if not (getattr(stream, "disposition", 0) & av.stream.Disposition.attached_pic):
            return stream
    return None

"""The camera of an export for LeRobot: pictures of recorded states, and what is said of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE
from pianomime.learn.export.picture_stats import PictureStats
from pianomime.learn.export.video_files import VideoFiles
from pianomime.world.parameters import key_travel
from pianomime.world.render import Painter, View
from pianomime.world.scene_look import key_colours
from pianomime.world.state import pressed

VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
"""Pattern of the paths of videos."""
VIDEO_MIB = 200
"""[MiB] of a file of video at most, LeRobot's default; one episode may be larger."""
_SIDES = range(16, 2049)
"""[pixels] that a picture may be wide or high: OpenGL may not draw larger ones."""


def check_view(view: View) -> None:
    """Refuse a size of pictures that cannot be rendered and encoded.

    Raises:
        InputError: width or height is odd, too small or too large.
    """
    if any(side % 2 or side not in _SIDES for side in view.size):
        raise InputError(
            f"width and height of pictures are even numbers from {_SIDES[0]} to {_SIDES[-1]}, not "
            f"{view.size[0]} and {view.size[1]}"
        )


@contextmanager
def open_camera(folder: Path, view: View) -> Iterator[Camera]:
    """A camera, within the block.

    Args:
        folder: of the export.
        view: which camera, and the size of its pictures.

    Raises:
        RenderUnavailable: there is no working OpenGL.
        OSError: a video cannot be written.
    """
    feature = f"observation.images.{view.camera}"
    pattern = VIDEO.replace("{video_key}", feature)
    with (
        Painter(*view.size, view.camera, smooth=True) as painter,
        VideoFiles(folder, pattern, VIDEO_MIB, view.size) as files,
    ):
        yield Camera(feature, painter, files)


class Camera:
    """Renders episodes into video files.

    Attributes:
        feature: name of the feature.
    """

    def __init__(self, feature: str, painter: Painter, files: VideoFiles) -> None:
        """See `open_camera`."""
        self.feature = feature
        self._painter, self._files = painter, files
        self._all = PictureStats()

    def record(
        self, columns: dict[str, NDArray[Any]], advance: Callable[[int], None]
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Render the next episode: picture k shows hands and keys as row k says they are.

        Keys that are down are coloured, as in films.

        Args:
            columns: `joints` and `keys` of T frames at least.
            advance: called with 1 after every picture.

        Returns:
            Where the pictures are, as LeRobot's columns about episodes, and their statistics.

        Raises:
            OSError: they cannot be written.
        """
        qpos = np.concatenate([columns["keys"] * key_travel(), columns["joints"]], axis=1)
        colours = key_colours(pressed(qpos))
        span = self._files.begin(len(qpos))
        stats = PictureStats()
        for pose, shown in zip(qpos, colours, strict=True):
            picture = self._painter.paint(pose, shown)
            self._files.add(picture)
            stats.add(picture)
            advance(1)
        self._all += stats
        place = {
            "chunk_index": span.chunk,
            "file_index": span.file,
            "from_timestamp": span.begin,
            "to_timestamp": span.end,
        }
        named = {f"videos/{self.feature}/{name}": value for name, value in place.items()}
        return named, stats.of_all()

    def stats(self) -> dict[str, NDArray[Any]]:
        """Statistics of the pictures of all episodes."""
        return self._all.of_all()

    def described(self) -> dict[str, Any]:
        """The feature as `info.json` has it."""
        width, height = self._painter.width, self._painter.height
        shape = [height, width, 3]
        return {
            "dtype": "video",
            "shape": shape,
            "names": ["height", "width", "channels"],
            "info": {
                "video.height": height,
                "video.width": width,
                "video.codec": "h264",
                "video.pix_fmt": "yuv420p",
                "video.is_depth_map": False,
                "video.fps": int(FRAME_RATE),
                "video.channels": shape[-1],
                "has_audio": False,
            },
        }

"""Video with landmarks, key grid, pressed keys and fingering drawn into it."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np

from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE, NO_KEY
from pianomime.progress import Progress, no_progress
from pianomime.video.drawing import Drawing
from pianomime.video.retarget import Retargeted
from pianomime.world.layout import FINGER_COUNT


def write_overlay(made: Retargeted, path: Path, progress: Progress = no_progress) -> None:
    """Write the video at 20 pictures per second, without sound.

    Args:
        made: the retargeted video.
        path: MP4 file; it appears only when complete.
        progress: called after every frame, in the phase "overlay".
    """
    drawing = Drawing(made.plane)
    finger_key = made.demonstration.plan.finger_key
    nothing = np.full((2, FINGER_COUNT), NO_KEY, np.int8)
    tracks = made.tracks
    with (
        atomic(path) as temporary,
        av.open(str(temporary), "w", format="mp4", options={"movflags": "+faststart"}) as film,
    ):
        stream: Any = None
        for number, frame in enumerate(made.film.frames(FRAME_RATE)):
            if number >= len(tracks):
                break
            drawn = drawing.draw(
                frame.picture,
                tracks.points[number],
                tracks.found[number],
                finger_key[number] if number < len(finger_key) else nothing,
            )
            # H.264 needs an even size.
            drawn = drawn[: drawn.shape[0] // 2 * 2, : drawn.shape[1] // 2 * 2]
            if stream is None:
                stream = film.add_stream("libx264", rate=round(FRAME_RATE))
                stream.height, stream.width = drawn.shape[:2]
                stream.pix_fmt = "yuv420p"
                stream.options = {"crf": "26", "preset": "superfast"}
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(drawn), format="rgb24")
            picture.pts, picture.time_base = number, Fraction(1, round(FRAME_RATE))
            film.mux(stream.encode(picture))
            progress("overlay", number + 1, len(tracks))
        film.mux(stream.encode(None))

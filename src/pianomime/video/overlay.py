"""Video with landmarks, key grid, pressed keys and fingering drawn into it."""

from __future__ import annotations

from contextlib import ExitStack
from itertools import islice
from pathlib import Path

import numpy as np

from pianomime.files import atomic
from pianomime.keyboard import FRAME_RATE, NO_KEY
from pianomime.mp4 import Mp4
from pianomime.music.sound import SAMPLE_RATE
from pianomime.progress import Progress, no_progress
from pianomime.video.drawing import Drawing
from pianomime.video.film.sound import film_sound
from pianomime.video.retarget import Retargeted
from pianomime.world.layout import FINGER_COUNT

_CRF = 26
"""Quality of the pictures: what a person has filmed need not be kept better than that."""


def write_overlay(made: Retargeted, path: Path, progress: Progress = no_progress) -> None:
    """Write the video at 20 pictures per second, with its sound if it has some.

    Args:
        made: the retargeted video.
        path: MP4 file; it appears only when complete.
        progress: called after every frame, in the phase "overlay".
    """
    drawing = Drawing(made.track)
    finger_key = made.demonstration.plan.finger_key
    nothing = np.full((2, FINGER_COUNT), NO_KEY, np.int8)
    tracks = made.tracks
    frames = islice(made.film.frames(FRAME_RATE), len(tracks))
    with atomic(path) as temporary, film_sound(made.film) as sound, ExitStack() as stack:
        film: Mp4 | None = None
        for number, frame in enumerate(frames):
            drawn = drawing.draw(
                number,
                frame.picture,
                tracks.points[number],
                tracks.found[number],
                finger_key[number] if number < len(finger_key) else nothing,
            )
            # H.264 needs an even size.
            height, width = (side // 2 * 2 for side in drawn.shape[:2])
            if film is None:
                rate = None if sound is None else SAMPLE_RATE
                film = stack.enter_context(Mp4(temporary, (width, height), rate, _CRF))
            begin, end = film.span
            film.add(drawn[:height, :width], None if sound is None else sound(end - begin))
            progress("overlay", number + 1, len(tracks))

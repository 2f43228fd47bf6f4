"""Makes the picture of the README's section on videos: one of our films, and what was seen in it.

    ./do run python docs/make_overlay.py

Our own hands are filmed from above, and `retarget` makes a demonstration of the film. It needs
OpenGL. Of the film everything but the hands is seen: MediaPipe takes robots for no hands, so where
the fingertips show is given, with a millimetre of noise.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np
from PIL import Image

from pianomime import Score, excerpt, load_player, songs
from pianomime.keyboard import FRAME_RATE
from pianomime.video import retarget as room
from pianomime.video.film.film import Film
from pianomime.video.overlay import write_overlay
from pianomime.video.retarget import RetargetConfig, retarget

sys.path.append(str(Path(__file__).parents[1] / "tests"))

import rendered_video

SONG = "petzold-minuet-g"
SECONDS = 12.0
TARGET = Path(__file__).parent / "images" / "retarget.jpg"
ROWS = slice(70, 470)
"""Of the picture: those with keys or hands in them."""


def main() -> None:
    """Play, film, make a demonstration of the film, and show its busiest moment."""
    score = excerpt(Score.from_midi(songs.path(SONG)), seconds=SECONDS)
    performance = load_player("zero-shot").play(score)
    with tempfile.TemporaryDirectory() as folder:
        film, midi, model, overlay = (
            Path(folder, name) for name in ("film.mp4", "song.mid", "not-used.task", "overlay.mp4")
        )
        rendered_video.write(film, performance, light_up=False)
        performance.played().to_midi(midi)
        model.touch()
        given = rendered_video.hands(performance)
        with (
            patch.object(room, "check_mediapipe"),
            patch.object(room, "HandDetector", lambda _: given),
        ):
            made = retarget(film, RetargetConfig(midi=midi, hand_model=model))
        write_overlay(made, overlay)
        pressing = (made.demonstration.plan.finger_key >= 0).any(axis=2).sum(axis=1)
        down = (made.demonstration.plan.finger_key >= 0).sum(axis=(1, 2))
        busiest = int(np.argmax(10 * pressing + down))
        picture = next(Film(overlay).frames(FRAME_RATE, busiest)).picture
    Image.fromarray(picture[ROWS]).save(TARGET, quality=88, optimize=True)
    print(f"{TARGET}: {TARGET.stat().st_size / 1000:.0f} kB; {made.demonstration.quality}")


if __name__ == "__main__":
    main()

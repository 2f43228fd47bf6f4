"""Makes the picture of the README: the hands in the middle of a song, and what they play.

    ./do run python docs/make_picture.py

It needs OpenGL, as films do.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from pianomime import Score, excerpt, load_player, songs
from pianomime.report import LIGHT, draw
from pianomime.world.render import render_frame

SONG = "bach-prelude-c"
SECONDS = 15.0
TARGET = Path(__file__).parent / "images" / "pianomime.jpg"
WIDTH = 1280


def main() -> None:
    """Play, draw, and put one above the other."""
    score = excerpt(Score.from_midi(songs.path(SONG)), seconds=SECONDS)
    performance = load_player("zero-shot").play(score)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "roll.png")
        draw(performance, path, LIGHT)
        with Image.open(path) as opened:
            roll = opened.convert("RGB")
    roll = roll.resize((WIDTH, round(roll.height * WIDTH / roll.width)), Image.Resampling.LANCZOS)
    # The moment in which most keys are down, and rightly so.
    moment = int(np.argmax((performance.pressed & score.roll()).sum(axis=1)))
    hands = Image.fromarray(
        render_frame(performance.qpos[moment], performance.pressed[moment], WIDTH, 540)
    )
    picture = Image.new("RGB", (WIDTH, hands.height + roll.height), "white")
    picture.paste(hands, (0, 0))
    picture.paste(roll, (0, hands.height))
    TARGET.parent.mkdir(exist_ok=True)
    picture.save(TARGET, quality=88, optimize=True)
    print(f"{TARGET}: {TARGET.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()

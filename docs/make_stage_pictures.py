"""Makes the pictures of replays in the documentation, in a headless Chromium.

    ./do run python docs/make_stage_pictures.py

It needs Chromium and the replays of docs/make_replays.py, and the extra `dev` for Playwright.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from browser import browsers

DOCS = Path(__file__).parent
REPLAYS = DOCS / "replays" / "performances"
IMAGES = DOCS / "images"
REPLAY = "document.querySelector('pianomime-replay')"
_STILL = 2500
"""[ms] A picture at rest is drawn at its best after a while."""


class Picture(NamedTuple):
    """A state of the page.

    Attributes:
        name: of the file.
        song: whose replay it is.
        seconds: at which time.
        keys: pressed before.
        size: of the window [pixels].
        dark: in the dark look.
    """

    name: str
    song: str
    seconds: float
    keys: str = ""
    size: tuple[int, int] = (1280, 900)
    dark: bool = False


PICTURES = (
    Picture("stage", "bach-prelude-c", 6.35),
    Picture("stage-dark", "beethoven-fur-elise", 3.1, "2", dark=True),
    Picture("stage-top", "satie-gymnopedie-1", 8.0, "3"),
    Picture("stage-hand", "beethoven-fur-elise", 5.0, "6"),
    Picture("stage-phone", "bach-prelude-c", 4.0, "", (390, 780)),
)


def main() -> None:
    """Open each replay, bring it into its state, and take a picture of it."""
    with browsers() as started, started.chromium() as chromium:
        for picture in PICTURES:
            _take(chromium, picture)


def _take(chromium: Any, picture: Picture) -> None:
    width, height = picture.size
    page = chromium.new_page(
        viewport={"width": width, "height": height},
        color_scheme="dark" if picture.dark else "light",
    )
    page.goto((REPLAYS / f"{picture.song}.html").as_uri())
    page.evaluate(f"{REPLAY}.ready")
    page.locator("pianomime-replay").focus()
    for key in picture.keys:
        page.keyboard.press(key)
    page.evaluate(f"{REPLAY}.currentTime = {picture.seconds}")
    page.wait_for_timeout(_STILL)
    target = IMAGES / f"{picture.name}.jpg"
    page.locator("section.replay").screenshot(path=target, type="jpeg", quality=85)
    print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB")
    page.close()


if __name__ == "__main__":
    main()

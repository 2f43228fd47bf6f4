"""Makes the pictures of replays and of the stage in the documentation, in a headless Chromium.

    ./do run python docs/make_stage_pictures.py

It needs Chromium and the replays of docs/make_replays.py, and the extra `dev` for Playwright.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from make_replays import PLAYED

from browser import browsers
from pianomime.stage.server import Stage

DOCS = Path(__file__).parent
REPLAYS = DOCS / "replays" / "performances"
IMAGES = DOCS / "images"
REPLAY = "document.querySelector('pianomime-replay')"
OTHER_REPLAY = "document.querySelectorAll('pianomime-replay')[1]"
SONG, SONG_SECONDS, PLAYERS = "beethoven-fur-elise", 5.0, ("zero-shot", "zero-shot-20hz")
"""What is played on the stage, the time that is shown, and by whom it is played."""
_STILL = 2500
"""[ms] A picture at rest is drawn at its best after a while."""
_PAUSE = 200
"""[ms] between two looks at the page."""


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
    """Take the pictures of replays, and those of the stage."""
    with browsers() as started, started.chromium() as chromium:
        for picture in PICTURES:
            _take(chromium, picture)
        with TemporaryDirectory() as out, Stage(Path(out), [PLAYED]) as stage:
            _take_stage(chromium, stage.url)


def _take(chromium: Any, picture: Picture) -> None:
    """Open a replay, bring it into its state, and take a picture of it."""
    width, height = picture.size
    page = chromium.new_page(
        viewport={"width": width, "height": height},
        color_scheme="dark" if picture.dark else "light",
    )
    page.goto((REPLAYS / picture.song / "report.html").as_uri())
    page.evaluate(f"{REPLAY}.ready")
    page.locator("pianomime-replay").focus()
    for key in picture.keys:
        page.keyboard.press(key)
    page.evaluate(f"{REPLAY}.currentTime = {picture.seconds}")
    _save(page, page.locator("section.replay"), picture.name)
    page.close()


def _take_stage(chromium: Any, url: str) -> None:
    """Have a song played, and compare it with the same by another player."""
    page = chromium.new_page(viewport={"width": 1440, "height": 1050}, color_scheme="light")
    page.goto(url)
    page.wait_for_selector("nav li")
    page.get_by_label("Effort").select_option("0")
    page.get_by_label("Player").select_option(PLAYERS[0])
    page.get_by_role("button", name=SONG).first.click()
    _wait(page, f"{REPLAY}.state === 'done'")
    page.evaluate(f"{REPLAY}.pause(), {REPLAY}.currentTime = {SONG_SECONDS}")
    _save(page, page, "stage-app")
    page.get_by_role("button", name="Compare").click()
    page.get_by_label("Player").select_option(PLAYERS[1])
    page.get_by_role("button", name="Try again").click()
    _wait(page, f"{OTHER_REPLAY}.state === 'done'")
    page.evaluate(f"{REPLAY}.pause(), {REPLAY}.currentTime = {SONG_SECONDS}")
    _save(page, page, "stage-compare")
    page.close()


def _wait(page: Any, what: str) -> None:
    # The page's content policy forbids Playwright's own way.
    while not page.evaluate(what):
        page.wait_for_timeout(_PAUSE)


def _save(page: Any, what: Any, name: str) -> None:
    """Take a picture of a page, or of a part of it, when it is at rest."""
    page.wait_for_timeout(_STILL)
    target = IMAGES / f"{name}.jpg"
    what.screenshot(path=target, type="jpeg", quality=85)
    print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()

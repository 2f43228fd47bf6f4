"""The browser of this machine, for tests of pages."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_OPTIONS = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--autoplay-policy=no-user-gesture-required",
)


class Browsers:
    """Starts browsers, which are all closed in the end."""

    def __init__(self, driver: Any, path: str) -> None:
        self._driver, self._path = driver, path

    @contextmanager
    def chromium(self, *options: str) -> Iterator[Any]:
        """A headless Chromium, as Playwright drives it.

        Args:
            options: more of its command line.
        """
        launched = self._driver.chromium.launch(
            executable_path=self._path, args=[*_OPTIONS, *options]
        )
        try:
            yield launched
        finally:
            launched.close()


@contextmanager
def browsers() -> Iterator[Browsers]:
    """What starts browsers; skips the test where there is none.

    While it is open, nothing else in this thread can use asyncio.
    """
    found = next(filter(None, map(shutil.which, _NAMES)), None)
    if found is None:
        pytest.skip("this machine has no Chromium")
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        yield Browsers(driver, found)

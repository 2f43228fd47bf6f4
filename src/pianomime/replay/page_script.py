"""The script with which a page shows replays, as `web/` builds it."""

from __future__ import annotations

from importlib.resources import files

from pianomime.errors import InputError

_NAME = "replay.js"


class PageMissing(InputError):  # noqa: N818 - a property of the installation
    """The script was not built; the message is one line that says how to."""


def page_script() -> str:
    """The JavaScript module that registers the element `<pianomime-replay>`.

    Raises:
        PageMissing: it was not built.
    """
    script = files("pianomime.replay") / "page" / _NAME
    if not script.is_file():
        raise PageMissing(
            "no hands in the page: its script is not built; from a checkout, `./do page` builds it"
        )
    return script.read_text("utf-8")

"""The script with which a page shows replays, as `web/` builds it."""

from __future__ import annotations

from importlib.resources import files

from pianomime.errors import InputError

REPLAY_SCRIPT = "replay.js"


class PageMissing(InputError):  # noqa: N818 - a property of the installation
    """The script was not built; the message is one line that says how to."""


def page_script(name: str = REPLAY_SCRIPT) -> str:
    """A JavaScript module: that which registers the element `<pianomime-replay>`, or another.

    Args:
        name: of the file.

    Raises:
        PageMissing: it was not built.
    """
    script = files("pianomime.replay") / "page" / name
    if not script.is_file():
        raise PageMissing(
            "no hands in 3D: the script of the page is not built; from a checkout, `./do page` "
            "builds it"
        )
    return script.read_text("utf-8")

"""The palette: colours that mean the same in every picture, film and page."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Theme:
    """Colours of a picture or a page, as "#rrggbb".

    Attributes:
        page: around the papers of a page.
        paper: behind a picture.
        black_keys: of the stripes of black keys.
        lines: of grids and frames.
        text: of text.
        faint_text: of text that matters less.
        hands: of the left hand, the right hand, and no hand.
        wanted: of what these should have played, and have not.
        wrong: of what is wrong, or was not seen.
    """

    page: str
    paper: str
    black_keys: str
    lines: str
    text: str
    faint_text: str
    hands: tuple[str, str, str]
    wanted: tuple[str, str, str]
    wrong: str


LIGHT = Theme(
    page="#f3f5f8",
    paper="#ffffff",
    black_keys="#f5f6f8",
    lines="#dde1e7",
    text="#1c2430",
    faint_text="#6b7686",
    hands=("#2467c9", "#e58a00", "#8a94a3"),
    wanted=("#cadcf6", "#fbe2b8", "#dfe3e8"),
    wrong="#d3124a",
)
DARK = Theme(
    page="#0f1216",
    paper="#171b21",
    black_keys="#12151a",
    lines="#2c333d",
    text="#e8ecf2",
    faint_text="#8d98a8",
    hands=("#5b9bf0", "#f2a232", "#7d8795"),
    wanted=("#22395c", "#503a16", "#343b45"),
    wrong="#ff4d7d",
)


def rgb(colour: str) -> tuple[int, int, int]:
    """Red, green and blue of a colour, 0..255.

    Args:
        colour: as "#rrggbb".
    """
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue

"""The common look of our web pages: each is one file that needs no other, and no network."""

from __future__ import annotations

import base64
from html import escape
from string import Template

from pianomime.palette import DARK, LIGHT, Theme

_PAGE = Template("""\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>$title</title>
<link rel="icon" href="data:,">
<style>
:root { $light }
@media (prefers-color-scheme: dark) {
  :root { $dark }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--page); color: var(--text);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif;
}
main { max-width: 1120px; margin: 0 auto; padding: 2.5rem 1.25rem 3rem; }
h1 { margin: 0; font-size: 1.9rem; line-height: 1.2; overflow-wrap: anywhere; }
.under { margin: .35rem 0 1.6rem; color: var(--faint); overflow-wrap: anywhere; }
section {
  background: var(--paper); border: 1px solid var(--line); border-radius: 14px;
  padding: 1.1rem 1.25rem; margin-bottom: 1.1rem;
}
section > :first-child { margin-top: 0; }
section > :last-child { margin-bottom: 0; }
h2 { margin: 0 0 .7rem; font-size: .95rem; font-weight: 600; color: var(--faint); }
audio, video, img { display: block; width: 100%; border-radius: 8px; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
td { padding: .35rem 0; border-top: 1px solid var(--line); vertical-align: top; }
tr:first-child td { border-top: 0; }
td:nth-child(2) { text-align: right; padding-left: 1rem; overflow-wrap: anywhere; }
small { color: var(--faint); }
.warning { border-left: 4px solid var(--wrong); }
footer { color: var(--faint); font-size: .85rem; }
$style</style>
</head>
<body>
<main>
$body</main>
</body>
</html>
""")


def web_page(title: str, body: str, style: str = "") -> str:
    """Make a page, which follows the browser's choice of a light or a dark look.

    Args:
        title: of the window, as plain text.
        body: HTML of the page: headings, and a `section` for each part.
        style: CSS that this page needs beside the common one; colours are `var(--page)`,
            `--paper`, `--text`, `--faint`, `--line`, `--left`, `--right` and `--wrong`.
    """
    return _PAGE.substitute(
        title=escape(title),
        light=_variables(LIGHT),
        dark=_variables(DARK),
        style=style,
        body=body,
    )


def data_url(kind: str, content: bytes) -> str:
    """The address of a file that the page itself holds.

    Args:
        kind: of the file, such as "image/png".
        content: of the file.
    """
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _variables(theme: Theme) -> str:
    colours = {
        "page": theme.page,
        "paper": theme.paper,
        "text": theme.text,
        "faint": theme.faint_text,
        "line": theme.lines,
        "left": theme.hands[0],
        "right": theme.hands[1],
        "wrong": theme.wrong,
    }
    return " ".join(f"--{name}: {colour};" for name, colour in colours.items())

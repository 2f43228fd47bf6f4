"""`report.html`: one page with film, sound, pictures and metrics, without the network.

It holds everything itself, but for the sound and the film of long pieces, which stand beside it.
"""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from string import Template
from urllib.parse import quote

from pianomime.evaluation.summary import Row

_PAGE = Template("""\
<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>$song - PianoMime</title>
<style>
:root {
  --paper: #f3f5f8; --card: #ffffff; --text: #1c2430; --faint: #6b7686; --line: #dde1e7;
  --accent: #2467c9;
}
@media (prefers-color-scheme: dark) {
  :root {
    --paper: #0f1216; --card: #171b21; --text: #e8ecf2; --faint: #8d98a8; --line: #2c333d;
    --accent: #5b9bf0;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--paper); color: var(--text);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif;
}
main { max-width: 1120px; margin: 0 auto; padding: 2.5rem 1.25rem 3rem; }
h1 { margin: 0; font-size: 1.9rem; line-height: 1.2; overflow-wrap: anywhere; }
.under { margin: .35rem 0 1.6rem; color: var(--faint); }
section {
  background: var(--card); border: 1px solid var(--line); border-radius: 14px;
  padding: 1.1rem 1.25rem; margin-bottom: 1.1rem;
}
h2 { margin: 0 0 .7rem; font-size: .95rem; font-weight: 600; color: var(--faint); }
.tiles {
  display: grid; grid-template-columns: repeat(auto-fit, minmax(140px, 1fr)); gap: .9rem;
  padding: 0; margin: 0 0 1.1rem;
}
.tiles div {
  background: var(--card); border: 1px solid var(--line); border-radius: 14px;
  padding: .85rem 1.1rem;
}
.tiles dt { color: var(--faint); font-size: .85rem; }
.tiles dd { margin: 0; font-size: 1.65rem; font-weight: 650; font-variant-numeric: tabular-nums; }
.tiles div:first-child dd { color: var(--accent); }
.sounds {
  display: grid; grid-template-columns: repeat(auto-fit, minmax(280px, 1fr)); gap: 1rem;
}
.sounds p { margin: 0 0 .4rem; }
audio, video, img { display: block; width: 100%; border-radius: 8px; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
td { padding: .35rem 0; border-top: 1px solid var(--line); vertical-align: top; }
tr:first-child td { border-top: 0; }
td:nth-child(2) { text-align: right; padding-left: 1rem; white-space: nowrap; }
small { color: var(--faint); }
.warning { border-left: 4px solid #d3124a; }
footer { color: var(--faint); font-size: .85rem; }
</style>
</head>
<body>
<main>
<h1>$song</h1>
<p class="under">Played by two simulated Shadow hands &middot; player <b>$player</b>,
effort $effort</p>
$warning<dl class="tiles">
$tiles</dl>
$film<section>
<h2>Sound</h2>
<div class="sounds">
<div><p>What the hands played</p><audio controls src="$played"></audio></div>
<div><p>What the score asks for</p><audio controls src="$wanted"></audio></div>
</div>
</section>
<section>
<h2>Piano roll</h2>
<picture>
<source media="(prefers-color-scheme: dark)" srcset="$dark_picture">
<img alt="Piano roll: notes wanted, played, missed and wrong, coloured by hand" src="$picture">
</picture>
</section>
<section>
<h2>Summary</h2>
<table>
$rows</table>
</section>
<footer>Made by PianoMime $version. F1 compares the keys that are down in every twentieth of a
second; onset F1 compares the beginnings of notes, within 50 ms.</footer>
</main>
</body>
</html>
""")

_TILES = {
    "f1": "F1",
    "precision": "Precision",
    "recall": "Recall",
    "onset_f1": "Onset F1",
    "pedal_f1": "Pedal F1",
}
_ROWS = {
    "song_seconds": ("Length of the song", "{:.1f} s"),
    "frames": ("Frames of 0.05 s", "{}"),
    "notes": ("Notes in the score", "{}"),
    "dropped_notes": ("Notes not planned: out of reach of ten fingers", "{}"),
    "blow_ups": ("Frames in which the physics became unstable", "{}"),
    "plan_seconds": ("Time to plan", "{:.2f} s"),
    "simulate_seconds": ("Time to simulate", "{:.2f} s"),
    "realtime_factor": ("Seconds of music per second of computing", "{:.1f}"),
}

MOST_EMBEDDED = 16 << 20
"""[bytes] Larger files stand beside the page: sound of more than 17 minutes, and long films."""


def page(
    summary: Row,
    version: str,
    played: str,
    wanted: str,
    picture: str,
    dark_picture: str,
    film: str | None,
) -> str:
    """Make the report as one HTML page.

    Args:
        summary: the performance's row of `pianomime.evaluation.summary.summarize`.
        version: version of PianoMime.
        played: address of the sound of the performance, see `source`.
        wanted: of the sound of the score.
        picture: of a picture of the piano roll for light pages.
        dark_picture: of one for dark pages.
        film: of the film of the performance, or None.
    """
    tiles = (
        f"<div><dt>{label}</dt><dd>{summary[name]:.3f}</dd></div>\n"
        for name, label in _TILES.items()
    )
    rows = (
        f"<tr><td>{label}</td><td>{form.format(summary[name])}</td></tr>\n"
        for name, (label, form) in _ROWS.items()
    )
    film_section = warning = ""
    if film is not None:
        film_section = (
            "<section>\n<h2>Video</h2>\n"
            f'<video controls preload="metadata" src="{film}"></video>\n'
            "</section>\n"
        )
    if summary["blow_ups"]:
        warning = (
            '<section class="warning">The physics became unstable during this performance, and the '
            "hands were put back: the metrics may be worse than the player.</section>\n"
        )
    return _PAGE.substitute(
        song=escape(str(summary["song"])),
        player=escape(str(summary["player"])),
        effort=summary["effort"],
        version=escape(version),
        tiles="".join(tiles),
        rows="".join(rows),
        film=film_section,
        warning=warning,
        played=played,
        wanted=wanted,
        picture=picture,
        dark_picture=dark_picture,
    )


def source(kind: str, file: Path) -> str:
    """Address of a file for the page: its content, or for large ones its name.

    Args:
        kind: media type, such as "audio/mpeg".
        file: in the folder of the page.
    """
    if file.stat().st_size > MOST_EMBEDDED:
        return quote(file.name)
    return f"data:{kind};base64,{base64.b64encode(file.read_bytes()).decode()}"

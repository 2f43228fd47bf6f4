"""`report.html`: one page with film, sound, pictures and metrics, without the network.

It holds everything itself, but for the sound and the film of long pieces, which stand beside it.
"""

from __future__ import annotations

from html import escape
from pathlib import Path
from string import Template
from urllib.parse import quote

from pianomime.evaluation.summary import Row
from pianomime.web_page import data_url, web_page

_STYLE = """\
.tiles {
  display: grid; grid-template-columns: repeat(auto-fit, minmax(140px, 1fr)); gap: .9rem;
  padding: 0; margin: 0 0 1.1rem;
}
.tiles div {
  background: var(--paper); border: 1px solid var(--line); border-radius: 14px;
  padding: .85rem 1.1rem;
}
.tiles dt { color: var(--faint); font-size: .85rem; }
.tiles dd { margin: 0; font-size: 1.65rem; font-weight: 650; font-variant-numeric: tabular-nums; }
.tiles div:first-child dd { color: var(--left); }
.sounds {
  display: grid; grid-template-columns: repeat(auto-fit, minmax(280px, 1fr)); gap: 1rem;
}
.sounds p { margin: 0 0 .4rem; }
"""
_BODY = Template("""\
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

MOST_EMBEDDED = 16 * 1024**2
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
    if remarks := summary["remarks"]:
        warning += (
            '<section class="warning">While the score was read: '
            f"{escape('; '.join(remarks))}.</section>\n"
        )
    body = _BODY.substitute(
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
    return web_page(f"{summary['song']} - PianoMime", body, _STYLE)


def source(kind: str, file: Path) -> str:
    """Address of a file for the page: its content, or for large ones its name.

    Args:
        kind: media type, such as "audio/mpeg".
        file: in the folder of the page.
    """
    if file.stat().st_size > MOST_EMBEDDED:
        return quote(file.name)
    return data_url(kind, file.read_bytes())

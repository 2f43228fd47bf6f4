"""`report.html`: one page with a replay, sound, a picture and metrics, without the network.

It holds everything itself, but for what long pieces are made of, which stands beside it.
"""

from __future__ import annotations

from html import escape
from pathlib import Path
from string import Template
from urllib.parse import quote

from pianomime.evaluation.measures import BODY, FRAMES, MORE_MUSIC, MUSIC, Measure
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
figure { margin: .9rem 0 0; }
figcaption { margin-bottom: .4rem; }
"""
_BODY = Template("""\
<h1>$song</h1>
<p class="under">Played by two simulated Shadow hands &middot; player <b>$player</b>,
effort $effort</p>
$warning$replay<dl class="tiles">
$tiles</dl>
$tables<footer>Made by PianoMime $version. Note F1 compares when each key was struck with when the
score asks for it, and velocity F1 also how hard; a phantom note is a strike that nobody asked for.
No lag is taken off. Protocol <code>$protocol</code>, touch <code>$touch</code>.</footer>
""")

# What is in the element is shown where there is no WebGL, or no script.
_REPLAY = Template("""\
<section class="replay">
<pianomime-replay$address>
$film<picture slot="picture">
<source media="(prefers-color-scheme: dark)" srcset="$dark_picture">
<img alt="Piano roll: notes played and missed, coloured by hand, and phantom notes" src="$picture">
</picture>
<figure slot="sound"><figcaption>What the hands played</figcaption>
<audio controls src="$played"></audio></figure>
<figure slot="wanted"><figcaption>What the score asks for</figcaption>
<audio controls src="$wanted"></audio></figure>
</pianomime-replay>
</section>
$data$script""")
_DATA_ID = "replay-data"

_TILES = MUSIC[:-1]
"""Those whose value is one number."""
_TABLES = {
    "What an ear would judge": (*MUSIC, *MORE_MUSIC),
    "Keys in frames, as in the paper": FRAMES,
    "Hands": BODY,
    "Summary": (
        Measure("Length of the song", "song_seconds", "{:.1f} s"),
        Measure("Frames of 0.05 s", "frames", "{}"),
        Measure("Notes in the score", "notes", "{}"),
        Measure("Notes not planned: out of reach of ten fingers", "dropped_notes", "{}"),
        Measure("Frames in which the physics became unstable", "blow_ups", "{}"),
        Measure("Time to plan", "plan_seconds", "{:.2f} s"),
        Measure("Time to simulate", "simulate_seconds", "{:.2f} s"),
        Measure("Seconds of music per second of computing", "realtime_factor", "{:.1f}"),
    ),
}
"""Tables by their headings."""

REPLAY_TYPE = "application/octet-stream"
_BASE64 = f"data:{REPLAY_TYPE};base64,"

MOST_EMBEDDED = 16 * 1024**2
"""[bytes] Larger files stand beside the page: sound of more than 17 minutes, replays of more than
25, and long films."""


def page(
    summary: Row,
    version: str,
    played: str,
    wanted: str,
    picture: str,
    dark_picture: str,
    film: str | None,
    replay: str,
    script: str | None,
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
        replay: of the replay of the performance.
        script: JavaScript module that shows it, or None where there is none.
    """
    tiles = (f"<div><dt>{tile.label}</dt><dd>{tile.show(summary)}</dd></div>\n" for tile in _TILES)
    warning = ""
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
        tables="".join(_table(heading, rows, summary) for heading, rows in _TABLES.items()),
        protocol=escape(str(summary["protocol"])),
        touch=escape(str(summary["touch"])),
        warning=warning,
        replay=_replay(played, wanted, picture, dark_picture, film, replay, script),
    )
    return web_page(f"{summary['song']} - PianoMime", body, _STYLE)


def _replay(
    played: str,
    wanted: str,
    picture: str,
    dark_picture: str,
    film: str | None,
    replay: str,
    script: str | None,
) -> str:
    embedded = replay.removeprefix(_BASE64) if replay.startswith(_BASE64) else None
    address, data = f' src="{replay}"', ""
    if embedded is not None:
        # A page that was opened from a disk may read what it holds, but no file beside it.
        address = f' data-from="{_DATA_ID}"'
        data = f'<script type="{REPLAY_TYPE}" id="{_DATA_ID}">{embedded}</script>\n'
    if script is None:
        address = data = ""
    return _REPLAY.substitute(
        address=address,
        data=data,
        script="" if script is None else _module(script),
        film="" if film is None else f'<video slot="film" controls src="{film}"></video>\n',
        played=played,
        wanted=wanted,
        picture=picture,
        dark_picture=dark_picture,
    )


def _module(script: str) -> str:
    # The end tag would end the script, also within a text of it.
    safe = script.replace("</script", "<\\/script")
    return f'<script type="module">\n{safe}\n</script>\n'


def _table(heading: str, rows: tuple[Measure, ...], summary: Row) -> str:
    cells = (f"<tr><td>{row.label}</td><td>{row.show(summary)}</td></tr>\n" for row in rows)
    return f"<section>\n<h2>{heading}</h2>\n<table>\n{''.join(cells)}</table>\n</section>\n"


def source(kind: str, file: Path) -> str:
    """Address of a file for the page: its content, or for large ones its name.

    Args:
        kind: media type, such as "audio/mpeg".
        file: in the folder of the page.
    """
    if file.stat().st_size > MOST_EMBEDDED:
        return quote(file.name)
    return data_url(kind, file.read_bytes())


def beside(page: Path) -> list[str]:
    """Names of the files in the folder of a page that it needs beside it.

    Args:
        page: the file of a page, see `source`.
    """
    html = page.read_text(encoding="utf-8")
    names = sorted(file.name for file in page.parent.iterdir())
    return [name for name in names if f'="{quote(name)}"' in html]

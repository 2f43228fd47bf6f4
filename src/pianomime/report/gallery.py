"""A gallery: a static site of performances, each with its replay, that needs no server."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any
from urllib.parse import quote

import numpy as np

from pianomime import __version__
from pianomime.errors import InputError
from pianomime.evaluation.evaluation import program_hash
from pianomime.evaluation.measures import BODY, FRAMES, MORE_MUSIC, MUSIC
from pianomime.evaluation.summary import Row
from pianomime.file_names import file_names
from pianomime.files import atomic, files_digest, staged
from pianomime.keyboard import KEYS
from pianomime.music import Score
from pianomime.players.performance import Performance, is_performance
from pianomime.progress import Progress, no_progress
from pianomime.replay import PageMissing, page_script
from pianomime.report.page import beside
from pianomime.report.write import FILES, write_report
from pianomime.staging import scratch
from pianomime.web_page import web_page
from pianomime.workers import Answer, work

INDEX = "index.html"
PAGES = "performances"
"""Folder in a site with a folder for each performance."""
PAGE = "report.html"
"""In that of a performance, with a MIDI file; what a long one's page needs lies beside it."""

_WORKER = "pianomime.report.gallery:page_maker"
_SAVED_BY_PLAY = "performance"
_CARD_FILE = "card.json"
"""Beside a page: what it was made of, and what the index says of it."""
_SORTED_BY = *MUSIC, *FRAMES, *MORE_MUSIC, *BODY
_NAMED = {measure.name: measure for measure in _SORTED_BY}
_SHOWN = tuple(
    _NAMED[f"music.{name}"]
    for name in ("note_f1_50", "note_f1_25", "velocity_f1", "phantoms_per_minute")
)
"""Measures on every card; the others are shown when they are sorted by."""
_ROLL = 320, KEYS
"""Width and height of the piano roll on a card, in its own units."""

_STYLE = """\
[hidden] { display: none !important; }
form { display: flex; flex-wrap: wrap; gap: .7rem; align-items: center; margin: 0 0 1.2rem; }
select, input, button {
  font: inherit; color: inherit; background: var(--paper); border: 1px solid var(--line);
  border-radius: 8px; padding: .35rem .6rem;
}
.cards { display: grid; gap: 1rem; grid-template-columns: repeat(auto-fill, minmax(300px, 1fr)); }
.card {
  position: relative; display: flex; flex-direction: column; gap: .5rem;
  background: var(--paper); border: 1px solid var(--line); border-radius: 14px; padding: 1rem;
}
.card:hover, .card:focus-within { border-color: var(--left); }
.card h2 { font-size: 1.05rem; margin: 0; overflow-wrap: anywhere; }
.card h2 a { color: var(--text); text-decoration: none; }
.card h2 a::after { content: ""; position: absolute; inset: 0; border-radius: 14px; }
.card .midi { position: relative; align-self: end; color: var(--faint); font-size: .85rem; }
.card svg { width: 100%; height: 88px; margin-top: auto; }
.card dl {
  display: grid; grid-template-columns: 1fr auto; gap: .1rem .8rem; margin: 0; font-size: .9rem;
  font-variant-numeric: tabular-nums;
}
.card dt { color: var(--faint); } .card dd { margin: 0; text-align: right; }
.card .sorted { font-weight: 650; }
footer { margin-top: 1.2rem; }
"""
_BODY = Template("""\
<h1>$title</h1>
<p class="under">$count of simulated hands. Open one to watch it in 3D, to hear it, and to see why
notes were missed.</p>
<form id="order" hidden>
<label>Sort by <select name="measure">$options</select></label>
<button name="direction" type="button"></button>
<label>Find <input name="find" type="search"></label>
</form>
<div class="cards">
$cards</div>
<footer>Made by PianoMime $version.</footer>
""")
_CARD = Template("""\
<article class="card" data-values="$values">
<h2><a href="$folder/$page">$song</a></h2>
<small>$player, effort $effort, world $world, $seconds s</small>
<svg viewBox="0 0 $width $height" preserveAspectRatio="none" aria-hidden="true">$roll</svg>
<dl>$measures</dl>
<a class="midi" href="$folder/$midi" download>MIDI</a>
</article>
""")


def performances_of(results: Sequence[Path]) -> list[Path]:
    """Files of performances in what commands have written.

    Args:
        results: files, and folders that `pianomime play` or `pianomime evaluate` wrote; those of
            deeper folders count.

    Returns:
        The files in the order given, those of a folder in that of their names; each once, however
        often and by whatever path it is given.

    Raises:
        InputError: something given is not there, or holds no performance.
    """
    found: dict[Path, Path] = {}
    for path in results:
        if path.is_dir():
            inside = [file for file in sorted(path.rglob("*.npz")) if is_performance(file)]
            if not inside:
                raise InputError(f"{path}: holds no performance")
        elif path.is_file():
            inside = [path]
        else:
            raise InputError(f"{path}: there is no such file or folder")
        for file in inside:
            found.setdefault(file.resolve(), file)
    return list(found.values())


def write_gallery(
    performances: Sequence[Path],
    site: Path,
    title: str,
    jobs: int | None,
    progress: Progress = no_progress,
    note: Callable[[str], None] = print,
) -> list[Row]:
    """Write a site: an index, and a folder for each performance with its page and its MIDI file.

    Pages that are there already, of the same performance and made by the same program with the same
    script, are not made again, so a run that was stopped goes on where it was.

    Args:
        performances: files of performances, each once.
        site: folder of the site; made if it is not there.
        title: heading of the index.
        jobs: how many pages are made at a time; one a core if None.
        progress: called after every page, in the phase "pages".
        note: called with one line for each performance that could not be shown, and once if pages
            lack their hands.

    Returns:
        The summaries of the performances shown, in the order given.

    Raises:
        InputError: none could be shown.
        OSError: a file cannot be written.
    """
    pages = site / PAGES
    pages.mkdir(parents=True, exist_ok=True)
    names = dict(zip(performances, _names(performances), strict=True))
    made_by = _made_by()
    cards: dict[Path, Row] = {}
    remarks: dict[str, None] = {}
    waiting = []
    for path in performances:
        made = _made(pages / names[path], path, made_by)
        if made is None:
            waiting.append(path)
        else:
            remarks |= dict.fromkeys(made["notes"])
            cards[path] = made
    progress("pages", len(cards), len(performances))

    def request(path: Path) -> dict[str, str]:
        return {"performance": os.fspath(path), "name": names[path]}

    setup = {"pages": os.fspath(pages), "made_by": made_by}
    with closing(work(_WORKER, waiting, jobs, setup, request)) as done:
        for path, row in done:
            if "error" in row:
                error = str(row["error"])
                named = error.startswith(os.fspath(path))
                remarks[error if named else f"{path}: {error}"] = None
            else:
                remarks |= dict.fromkeys(row["notes"])
                cards[path] = row
            progress("pages", len(cards), len(performances))
    for remark in remarks:
        note(remark)
    if not cards:
        raise InputError(f"{site}: none of the performances could be shown")
    shown = [(names[path], cards[path]) for path in performances if path in cards]
    with atomic(site / INDEX) as temporary:
        temporary.write_text(_index(title, shown), encoding="utf-8")
    return [card["row"] for _, card in shown]


def page_maker(setup: dict[str, str]) -> Answer:
    """What makes the pages of a gallery, for `pianomime.workers.work`.

    Args:
        setup: `pages`, the folder of them, and `made_by`, which tells what makes them.
    """
    pages, made_by = Path(setup["pages"]), setup["made_by"]

    def answer(request: dict[str, str]) -> Row:
        path, name = Path(request["performance"]), request["name"]
        # Not `download="..."` alone: browsers heed that only on a site, not on a disk.
        folder, midi = pages / name, f"{name}.mid"
        of = _digest(path, made_by)
        performance = Performance.load(path)
        notes: list[str] = []
        with scratch() as made, staged(folder, (*FILES, midi, _CARD_FILE)) as inside:
            row = write_report(performance, made, False, no_progress, notes.append)
            shutil.copy(made / "performance.mid", inside / midi)
            for part in (PAGE, *beside(made / PAGE)):
                shutil.copy(made / part, inside)
            parts = [file.name for file in inside.iterdir()]
        roll = _roll(performance)
        card = {"of": of, "parts": parts, "row": row, "roll": roll, "notes": notes}
        # Last, so that what it stands for is there.
        with atomic(folder / _CARD_FILE) as temporary:
            temporary.write_text(json.dumps(card, ensure_ascii=False), encoding="utf-8")
        return card

    return answer


def _names(performances: Sequence[Path]) -> list[str]:
    """A name for the folder of each performance; one that `play` wrote has that of its folder."""
    absolute = [path.resolve() for path in performances]
    # With a suffix, which `file_names` takes off.
    short = [
        Path(f"{path.parent}.npz") if path.stem == _SAVED_BY_PLAY else path for path in absolute
    ]
    # Beside X/performance.npz there may be X.npz.
    count = Counter(short)
    named = [name if count[name] == 1 else path for name, path in zip(short, absolute, strict=True)]
    common = Path(os.path.commonpath([path.parent for path in named]))
    return file_names([path.relative_to(common) for path in named])


def _made_by() -> str:
    """Changes with all that decides what a page of a performance is like."""
    try:
        script = page_script()
    except PageMissing:  # It may be there next time.
        script = ""
    return f"{program_hash()} {hashlib.sha256(script.encode()).hexdigest()}"


def _digest(performance: Path, made_by: str) -> str:
    return f"{made_by} {files_digest([performance])}"


def _made(folder: Path, performance: Path, made_by: str) -> Row | None:
    """The card of a page that was made of this performance before, or None."""
    try:
        card: Any = json.loads((folder / _CARD_FILE).read_text(encoding="utf-8"))
        there = all((folder / name).is_file() for name in card["parts"])
        return card if there and card["of"] == _digest(performance, made_by) else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _roll(performance: Performance) -> list[str]:
    """SVG paths of what was played: by the left hand, by the right, by nobody that is known."""
    score, plan = performance.score, performance.plan
    hand = np.full(len(score), -1) if plan is None else plan.note_hand
    return [_path(score, hand == number, performance.song_seconds) for number in (0, 1, -1)]


def _path(score: Score, chosen: Any, seconds: float) -> str:
    width, _ = _ROLL
    # The lowest key is at the bottom.
    return "".join(
        f"M{width * on / seconds:.1f} {KEYS - key - 0.5}H{width * off / seconds:.1f}"
        for key, on, off in zip(
            score.key[chosen], score.onset[chosen], score.offset[chosen], strict=True
        )
    )


def _index(title: str, shown: Sequence[tuple[str, Row]]) -> str:
    options = "".join(f"<option>{escape(measure.label)}</option>" for measure in _SORTED_BY)
    count = "One performance" if len(shown) == 1 else f"{len(shown)} performances"
    body = _BODY.substitute(
        title=escape(title),
        count=count,
        options=f"<option>song</option>{options}",
        cards="".join(_card(name, card) for name, card in shown),
        version=escape(__version__),
    )
    script = files("pianomime.report") / "gallery.js"
    body += f"<script>\n{script.read_text('utf-8')}</script>\n"
    return web_page(title, body, _STYLE)


def _card(name: str, card: Row) -> str:
    row, (width, height) = card["row"], _ROLL
    colours = ("--left", "--right", "--faint")
    values = {measure.label: measure.show(row) for measure in _SORTED_BY}
    return _CARD.substitute(
        folder=f"{PAGES}/{quote(name)}",
        page=PAGE,
        midi=f"{quote(name)}.mid",
        values=escape(json.dumps({"song": row["song"], **values}, ensure_ascii=False)),
        song=escape(str(row["song"])),
        player=escape(str(row["player"])),
        effort=row["effort"],
        world=escape(str(row["world"])),
        seconds=round(row["song_seconds"]),
        width=width,
        height=height,
        roll="".join(
            f'<path d="{path}" stroke="var({colour})" stroke-width="1.6" fill="none"/>'
            for path, colour in zip(card["roll"], colours, strict=True)
            if path
        ),
        measures="".join(
            f"<dt>{escape(measure.label)}</dt><dd>{measure.show(row)}</dd>" for measure in _SHOWN
        ),
    )

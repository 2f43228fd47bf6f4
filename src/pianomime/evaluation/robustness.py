"""Robustness: how well songs are played where the world is not the one that the player knows."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import warnings
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from pianomime.errors import InputError
from pianomime.evaluation.evaluation import program_hash
from pianomime.evaluation.mean import mean
from pianomime.evaluation.robust_grid import GRID, NOMINAL
from pianomime.evaluation.robust_play import LOOPS, OPEN
from pianomime.evaluation.robust_worker import MEASURES, NUMBERS, ROBUST_ROW, ROBUST_WORKER
from pianomime.file_names import file_name
from pianomime.files import atomic
from pianomime.progress import Progress, no_progress
from pianomime.sealed_json import read_json, sealed, unsealed
from pianomime.shown import markdown_cell
from pianomime.staging import hold, sweep
from pianomime.workers import work

Row = dict[str, Any]
_SCORES = {"f1": "frame F1", "note_f1_50": "note F1, 50 ms"}
"""What is compared with the nominal world, and what tables call it."""


def robustness(
    results: Mapping[str, Any],
    out: str | Path,
    *,
    jobs: int | None = None,
    progress: Progress = no_progress,
) -> dict[str, Any]:
    """Play what an evaluation found again, in worlds that differ (`robust_grid.GRID`).

    Controls found in the nominal world are replayed as they are, open loop, and with feedback,
    closed loop (`track.nominal_tracking`). Songs that were finished before are not played again, as
    in `evaluate`.

    Args:
        results: what `evaluate` returned.
        out: the folder that it was given: `robust.json`, `robust.md` and `robust.csv` are written
            there, and finished songs kept in `robust/`.
        jobs: processes; one a core that this one may use if None.
        progress: called with the songs done and the songs in all.

    Returns:
        What `robust.json` holds: `player`, `effort`, `world`, `seconds` and `lead_in` of the
        results; `songs`, a row each, with an `error` for those that failed; `mean` by loop and
        case; `change` of the means of the same loop in the nominal world, likewise; and
        `worst_open`, the worst change of each score in an open loop, over the mild cases.

    Raises:
        InputError: `jobs` is less than 1.
        OSError: `out` cannot be written.
    """
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs must be 1 or more, not {jobs}")
    out = Path(out)
    kept = out / "robust"
    kept.mkdir(parents=True, exist_ok=True)
    made_by = f"{json.dumps([str(case) for case in GRID])} {program_hash()}".encode()
    sweep(kept)
    with hold(out):
        rows: dict[int, Row] = {}
        waiting: list[tuple[int, str, Path, Path]] = []
        for number, played in enumerate(results["songs"]):
            song = played["song"]
            if "performance" not in played:
                why = played.get("error", "its performance was deleted; evaluate in another folder")
                rows[number] = {"song": song, "error": why}
                continue
            path = out / played["performance"]
            digest = hashlib.sha256(made_by + path.read_bytes()).hexdigest()[:16]
            file = kept / f"{file_name(song)}-{digest}.json"
            row = _known(file)
            if row is None:
                waiting.append((number, song, path, file))
            else:
                rows[number] = row
        progress("robustness", len(rows), len(results["songs"]))

        def request(item: tuple[int, str, Path, Path]) -> dict[str, str]:
            return {"song": item[1], "performance": str(item[2])}

        with closing(work(ROBUST_WORKER, waiting, jobs, None, request)) as done:
            for (number, song, _, file), row in done:
                if "error" not in row:
                    _write(file, _json(sealed(row, file.name)))
                rows[number] = {"song": song, **row}
                progress("robustness", len(rows), len(results["songs"]))
        listed = [rows[number] for number in range(len(results["songs"]))]
        table = _compared(results, listed)
        _write(out / "robust.json", _json(table))
        _write(out / "robust.md", robust_markdown(table))
        _write(out / "robust.csv", _csv(table))
    return table


def robust_markdown(table: Mapping[str, Any]) -> str:
    """The means, and how far they are from those of the nominal world, as Markdown.

    Args:
        table: what `robustness` returns.
    """
    heads = [f"{score}, {loop} loop" for loop in LOOPS for score in _SCORES.values()]
    lines = [f"| world | {' | '.join(heads)} |", f"| --- |{' ---: |' * len(heads)}"]
    for case in GRID:
        cells = [
            _cell(table["mean"], table["change"], loop, case.name, score)
            for loop in LOOPS
            for score in _SCORES
        ]
        lines.append(f"| {case.name} | {' | '.join(cells)} |")
    lines.append("")
    lines += [
        f"{markdown_cell(row['song'])} failed: {markdown_cell(row['error'])}\n"
        for row in table["songs"]
        if "error" in row
    ]
    for score, label in _SCORES.items():
        worst = table["worst_open"].get(score)
        if worst is not None:
            lines.append(f"Worst change of {label}, open loop, mild cases: {worst:+.3f}\n")
    return "\n".join(lines).rstrip("\n") + "\n"


def _compared(results: Mapping[str, Any], rows: list[Row]) -> dict[str, Any]:
    good = [row for row in rows if "error" not in row]
    means: dict[str, Any] = {}
    change: dict[str, Any] = {}
    for loop in LOOPS if good else ():
        cases = [case.name for case in GRID if case.name in good[0][loop]]
        means[loop] = {
            name: mean([row[loop][name] for row in good], NUMBERS).value for name in cases
        }
        nominal = means[loop][NOMINAL.name]
        change[loop] = {
            name: {score: _less(means[loop][name][score], nominal[score]) for score in _SCORES}
            for name in cases
        }
    worst = {}
    for score in _SCORES if good else ():
        changes = [change[OPEN][case.name][score] for case in GRID if case.summed_up]
        worst[score] = min((each for each in changes if each is not None), default=None)
    asked = {name: results[name] for name in ("player", "effort", "world", "seconds", "lead_in")}
    return {**asked, "songs": rows, "mean": means, "change": change, "worst_open": worst}


def _less(value: float | None, nominal: float | None) -> float | None:
    return None if value is None or nominal is None else round(value - nominal, 6)


def _cell(means: Row, change: Row, loop: str, case: str, score: str) -> str:
    """A mean with its change; "-" where there is none."""
    value = means.get(loop, {}).get(case, {}).get(score)
    if value is None:
        return "-"
    return f"{value:.3f} ({change[loop][case][score]:+.3f})"


def _csv(table: Mapping[str, Any]) -> str:
    """A line for each song, loop and case."""
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(["song", "loop", "world", *MEASURES])
    for row in table["songs"]:
        for loop in LOOPS:
            for name, numbers in row.get(loop, {}).items():
                lines.writerow([row["song"], loop, name, *(numbers[key] for key in MEASURES)])
    return text.getvalue()


def _known(file: Path) -> Row | None:
    """The row of a finished song; None where it has to be played, which a warning explains."""
    try:
        return unsealed(read_json(file), ROBUST_ROW, file.name)
    except FileNotFoundError:
        pass
    except (InputError, OSError) as error:
        warnings.warn(f"{file}: damaged ({error}); the song is played again", stacklevel=3)
    return None


def _json(content: Row) -> str:
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _write(path: Path, text: str) -> None:
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")

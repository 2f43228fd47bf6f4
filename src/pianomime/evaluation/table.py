"""Results as Markdown: what an ear would judge, what the paper measures, how the hands moved."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pianomime.evaluation.measures import BODY, FRAMES, MUSIC, Measure
from pianomime.evaluation.summary import Row
from pianomime.shown import markdown_cell

_Columns = dict[str, Callable[[Row], str]]
"""What shows a row, or the mean, by the head of its column."""


def markdown(results: dict[str, Any]) -> str:
    """The results as Markdown: tables of songs and their means, and one of causes.

    Args:
        results: what `pianomime.evaluate` returns.
    """
    good = [row for row in results["songs"] if "error" not in row]
    tables = [_songs(results["songs"], results["mean"], _columns(MUSIC))]
    if good:
        run = Measure("real time", "realtime_factor", "{:.1f}x")
        frames = _columns((*FRAMES, run)) | {"left out": _left_out, "broke": _broke}
        tables += [_songs(good, results["mean"], columns) for columns in (frames, _columns(BODY))]
    mended = [row for row in good if row.get("remarks")]
    if mended:
        tables.append(
            [
                "| song | mended or left out when it was read |",
                "| --- | --- |",
                *(
                    f"| {markdown_cell(row['song'])} | {markdown_cell('; '.join(row['remarks']))} |"
                    for row in mended
                ),
            ]
        )
    causes = sorted(
        (
            (share, kind, cause)
            for kind, shares in results["causes"].items()
            for cause, share in shares.items()
        ),
        reverse=True,
    )
    if causes:
        tables.append(
            [
                "| cause | | of the key-frames wanted |",
                "| --- | --- | ---: |",
                *(f"| {cause} | {kind} | {share:.2%} |" for share, kind, cause in causes),
            ]
        )
    return "\n\n".join("\n".join(lines) for lines in tables) + "\n"


def _songs(rows: list[Row], mean: Row, columns: _Columns) -> list[str]:
    """The lines of a table of songs."""
    lines = [_line("song", *columns), _line("---", *("---:" for _ in columns))]
    for row in rows:
        song = markdown_cell(row["song"])
        if "error" in row:
            empty = [""] * (len(columns) - 1)
            lines.append(_line(song, f"failed: {markdown_cell(row['error'])}", *empty))
        else:
            lines.append(_line(song, *(show(row) for show in columns.values())))
    if mean:
        lines.append(_line("**mean**", *(show(mean) for show in columns.values())))
    return lines


def _line(*cells: str) -> str:
    return "".join(f"| {cell} " if cell else "| " for cell in cells) + "|"


def _columns(measures: tuple[Measure, ...]) -> _Columns:
    return {measure.label: measure.show for measure in measures}


def _left_out(row: Row) -> str:
    return f"{_count(row['dropped_notes'])}/{_count(row['notes'])}"


def _broke(row: Row) -> str:
    return _count(row["blow_ups"])


def _count(number: float) -> str:
    """A count of a row, which is whole, or the mean of counts."""
    return str(number) if isinstance(number, int) else f"{number:.1f}"

"""Experts of many songs: one process per song on this machine, or one task on a Ray cluster."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

from pianomime.errors import InputError, WorkFailed
from pianomime.file_names import file_names
from pianomime.files import atomic
from pianomime.keyboard import EXCERPT_SECONDS
from pianomime.learn.expert.config import ExpertConfig
from pianomime.learn.expert.expert_worker import EXPERT_WORKER, expert_request
from pianomime.learn.expert.f1_chart import draw_f1_chart
from pianomime.learn.runs.run import is_run
from pianomime.music.excerpt import check_part
from pianomime.progress import Progress, no_progress
from pianomime.shown import markdown_cell
from pianomime.songs.find import MIDI_SUFFIXES, files_below
from pianomime.staging import hold
from pianomime.workers import Row, unwritable, work


def train_experts(
    folder: Path,
    out: Path,
    config: ExpertConfig,
    start: float = 0.0,
    seconds: float = EXCERPT_SECONDS,
    jobs: int | None = None,
    ray: str | None = None,
    progress: Progress = no_progress,
) -> list[Row]:
    """Train an expert of every demonstration and MIDI file in a folder.

    Each song has a run folder in `out`. Interrupted runs resume, and finished ones are kept. A song
    that fails is a row with an `error`.

    Args:
        folder: is searched for songs, with all folders below it.
        out: folder for the runs, and for `experts.json`, `experts.md` and `experts.png`.
        config: how the experts are made.
        start: where the excerpt of each begins [s].
        seconds: its length at most [s].
        jobs: songs trained at the same time on this machine; one for each core if None.
        ray: address of a Ray cluster whose nodes all see both folders; "local" starts one here.
        progress: called with the songs done, the songs in all and their mean F1 so far.

    Returns:
        A row for each song, in the order of their names.

    Raises:
        InputError: settings do not fit, there are no songs, `out` is their folder, or there is no
            such cluster.
        WorkFailed: no expert could be trained, or the disk is full; results of an earlier call
            stay.
        OSError: `out` cannot be written.
    """
    check_part(start, seconds)
    songs = find_experts_songs(folder, out)
    if jobs is not None and jobs < 1:
        raise InputError(f"jobs must be 1 or more, not {jobs}")
    if out.is_file():
        raise InputError(f"{out}: is a file; a folder is needed")
    out.mkdir(parents=True, exist_ok=True)
    requests = {
        name: expert_request(song.resolve(), out.resolve() / name, config, start, seconds)
        for name, song in songs.items()
    }
    with hold(out):
        rows: dict[str, Row] = {}

        def report() -> None:
            f1 = [row["f1"] for row in rows.values() if "error" not in row]
            remark = f"mean F1 {sum(f1) / len(f1):.3f}" if f1 else ""
            progress("songs", len(rows), len(songs), remark)

        report()
        if ray is None:
            trained = work(EXPERT_WORKER, requests, jobs, request=requests.__getitem__)
        else:
            from pianomime.ray_cluster import on_cluster

            trained = on_cluster(EXPERT_WORKER, requests, ray, request=requests.__getitem__)
        with closing(trained):
            for name, row in trained:
                if "unwritable" in row:
                    raise unwritable(name, row["unwritable"])
                rows[name] = {"song": name, **row}
                report()
        ordered = [rows[name] for name in songs]
        none = all("error" in row for row in ordered)
        # The results of an earlier call, if any, are better than none.
        if not (none and (out / "experts.json").exists()):
            _write(out / "experts.json", json.dumps(ordered, indent=1) + "\n")
            _write(out / "experts.md", experts_table(ordered))
        if none:
            first = f"{ordered[0]['song']}: {ordered[0]['error']}"
            more = f", and {len(ordered) - 1} more" if len(ordered) > 1 else ""
            raise WorkFailed(f"no expert was trained: {first}{more}")
        draw_f1_chart(ordered, out / "experts.png")
        return ordered


def find_experts_songs(folder: Path, out: Path | None = None) -> dict[str, Path]:
    """Demonstrations and MIDI files of a folder by the names of their runs, in order.

    Args:
        folder: is searched with all folders below it, except for run folders.
        out: folder of the results, which is left out as well.

    Raises:
        InputError: there is no such folder, nothing in it, or it is `out`.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder")
    if out is not None and out.resolve() == folder.resolve():
        raise InputError(f"{out}: holds the songs; name another folder for the results")
    results = None if out is None else out.resolve()
    if results is not None and not results.is_relative_to(folder.resolve()):
        results = None  # Also where the songs are a folder among the results.
    kind = "demonstrations or MIDI files"
    files = [
        file
        for file in files_below(folder, (".npz", *MIDI_SUFFIXES), kind)
        if not is_run(file.parent)
        and not (results is not None and file.resolve().is_relative_to(results))
    ]
    if not files:
        raise InputError(f"{folder}: no {kind} in this folder")
    return dict(zip(file_names([file.relative_to(folder) for file in files]), files, strict=True))


def experts_table(rows: list[Row]) -> str:
    """The rows as Markdown, and their mean."""
    lines = ["| song | F1 | precision | recall | steps |", "| --- | ---: | ---: | ---: | ---: |"]
    for row in rows:
        song = markdown_cell(row["song"])
        if "error" in row:
            lines.append(f"| {song} | failed: {markdown_cell(row['error'])} | | | |")
        else:
            cells = " | ".join(f"{row[name]:.3f}" for name in ("f1", "precision", "recall"))
            lines.append(f"| {song} | {cells} | {row['steps']} |")
    good = [row for row in rows if "error" not in row]
    if good:
        means = (sum(row[n] for row in good) / len(good) for n in ("f1", "precision", "recall"))
        lines.append(f"| **mean of {len(good)}** | {' | '.join(f'{m:.3f}' for m in means)} | |")
    return "\n".join(lines) + "\n"


def _write(path: Path, text: str) -> None:
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")

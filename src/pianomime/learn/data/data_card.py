"""The card of a data set: a page that says what it holds, how it was made, and how to read it."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

from pianomime import __version__
from pianomime.files import files_digest
from pianomime.keyboard import FRAME_RATE
from pianomime.learn.data.episode import COLUMNS, EVENTS, Column
from pianomime.learn.data.trajectories import TrajectoryData
from pianomime.shown import markdown_cell, shown
from pianomime.songs import names
from pianomime.songs import path as song_path

_HOUR = 3600
"""Seconds."""
_SIZES = (
    (1_000, "n<1K"),
    (10_000, "1K<n<10K"),
    (100_000, "10K<n<100K"),
    (1_000_000, "100K<n<1M"),
    (10_000_000, "1M<n<10M"),
    (100_000_000, "10M<n<100M"),
)
"""Numbers of rows below which a card has one of the names that catalogues of data sets know."""
_LARGEST = "100M<n<1B"

_PUBLIC_DOMAIN = (
    "The songs are those that are bundled with PianoMime. They are in the public domain, and so",
    "is this data set (CC0 1.0).",
)
_UNKNOWN_LICENCE = (
    "The licence of the songs is unknown to the program: that of each MIDI file holds for",
    "what was made of it.",
)


def data_card(path: Path) -> str:
    """The card of a data set that `pianomime perform` made, in Markdown with front matter.

    Args:
        path: of the data set.

    Raises:
        InputError: it cannot be read.
    """
    data = TrajectoryData.open(path)
    frames, events = int(data.ends[-1]), int(data.event_ends[-1])
    songs = {row["song_id"] for row in data.episodes}
    mean_f1 = sum(row["f1"] for row in data.episodes) / len(data)
    splits = Counter(row["split"] for row in data.episodes)
    size = next((name for most, name in _SIZES if frames < most), _LARGEST)
    settings = data.making.settings
    noisy = (
        "The controls that were played had noise on them; `action` is what the player would have "
        "sent in each state (DART), so that policies learn to recover.\n\n"
        if settings["noise"]
        else ""
    )
    bundled = {files_digest([song_path(name)]) for name in names()}
    # What learned policies play may be bound to the data that they learned from: no weights.
    free = settings["player_files"] == files_digest([]) and all(
        row["source"]["digest"] in bundled for row in data.episodes
    )
    parts = ", ".join(f"{number} of the split {shown(name)}" for name, number in splits.items())
    front = [
        "---",
        f"pretty_name: {json.dumps(shown(path.name))}",
        "license: cc0-1.0" if free else "license: unknown",
        "task_categories:",
        "- robotics",
        "tags:",
        "- robotics",
        "- piano",
        "- imitation-learning",
        "- mujoco",
        "size_categories:",
        f"- {size}",
        "---",
    ]
    return "\n".join(
        [
            *front,
            f"# {markdown_cell(path.name)}",
            "",
            "Two simulated robot hands (MuJoCo) play the piano: what they sensed and what was sent",
            f"to them, {FRAME_RATE:g} times a second. Made by PianoMime {__version__} "
            "(`pianomime perform`).",
            "",
            *(_PUBLIC_DOMAIN if free else _UNKNOWN_LICENCE),
            "",
            "## What it holds",
            "",
            f"- {len(data)} episodes of {len(songs)} songs: {parts}",
            f"- {frames / FRAME_RATE / _HOUR:.3g} hours of playing: {frames} frames, {events} key "
            "events",
            f"- mean F1 of the keys, frame by frame: {mean_f1:.3f}",
            f"- world: {data.episodes[0]['world']}",
            "",
            noisy + "One row is a frame, one episode stands after the other.",
            "",
            _table(COLUMNS, frames),
            "",
            "What keys sensed between frames, one row an event:",
            "",
            _table(EVENTS, events),
            "",
            f"`episode_end` and `event_end` ({len(data)},) are one past the last row, and the last",
            "event, of each episode. The attribute `episodes` of the group has a row for each:",
            "`name`, `f1`, `base` (the controller that `base_control` is of), `song_id` (the same",
            "for files of the same music), `split`, `world`, `digests` (of the episode's part of",
            "each array) and `source`: title and SHA-256 (`digest`) of the MIDI file, player,",
            "effort, seed, and the version of the program.",
            "",
            "## Splits",
            "",
            "Only episodes of the split `train` are for training. What part of them is kept for",
            "validation is decided by song when a policy is trained (`Dataset.split`), so that no",
            "song is in both.",
            "",
            "## How it was made",
            "",
            "| setting | value |",
            "| --- | --- |",
            *(
                f"| {markdown_cell(name)} | {markdown_cell(json.dumps(value))} |"
                for name, value in settings.items()
            ),
            "",
            f"Songs that could not be played: {len(data.making.failed)}",
            "",
            *(
                f"- {markdown_cell(row['song'])}: {markdown_cell(row['error'])}"
                for row in data.making.failed
            ),
            "",
            "## How to read it",
            "",
            "With zarr (3 or newer) alone:",
            "",
            "```python",
            "import zarr",
            "",
            f'data = zarr.open_group({json.dumps(shown(path.name))}, mode="r")',
            'ends = data["episode_end"][:]',
            "for first, end in zip([0, *ends], ends):",
            '    joints, action = data["joints"][first:end], data["action"][first:end]',
            "```",
            "",
            "With PianoMime: `pianomime train POLICY --experts` and its path.",
            "",
        ]
    )


def _table(columns: dict[str, Column], rows: int) -> str:
    lines = ["| array | shape | type | what |", "| --- | --- | --- | --- |"]
    for name, column in columns.items():
        shape = ", ".join(map(str, (rows, *column.shape)))
        what = markdown_cell(column.description)
        lines.append(f"| `{name}` | ({shape}) | {column.dtype} | {what} |")
    return "\n".join(lines)

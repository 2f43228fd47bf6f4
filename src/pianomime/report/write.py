"""The report of a performance: metrics, MIDI, sound, pictures, video, and a page with all of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from matplotlib.colors import to_rgb

from pianomime import __version__
from pianomime.evaluation.summary import Row, summarize
from pianomime.music import render_audio, write_wav
from pianomime.music.sound import SAMPLE_RATE
from pianomime.players.performance import Performance
from pianomime.progress import Progress
from pianomime.report.mp3 import mp3
from pianomime.report.page import page
from pianomime.report.picture import draw
from pianomime.report.roll import DARK, LIGHT
from pianomime.world.render import RenderUnavailable, write_video
from pianomime.world.scene_look import key_colours

FILES = (
    "report.html",
    "report.json",
    "performance.npz",
    "performance.mid",
    "performance.wav",
    "performance.mp4",
    "piano_roll.png",
    "piano_roll_dark.png",
)
"""All files of a report; only the video may be missing."""


def write_report(
    performance: Performance,
    folder: Path,
    video: bool,
    progress: Progress,
    note: Callable[[str], None],
) -> Row:
    """Write the files of a report, `FILES`.

    Args:
        performance: the performance to report on.
        folder: an existing folder for the files.
        video: whether to render a video, if this machine can.
        progress: called in the phases "reporting" and "rendering".
        note: called with one line that says what could not be made and why.

    Returns:
        The summary, as in `report.json`.
    """
    progress("reporting", 0, 0)
    row = summarize(performance)
    played = performance.played()
    performance.save(folder / "performance.npz")
    played.to_midi(folder / "performance.mid")
    audio = render_audio(played, SAMPLE_RATE)
    write_wav(folder / "performance.wav", audio, SAMPLE_RATE)
    draw(performance, folder / "piano_roll.png", LIGHT)
    draw(performance, folder / "piano_roll_dark.png", DARK)
    if video:
        colours = key_colours(performance.pressed)
        colours[performance.pressed & ~performance.score.roll()] = to_rgb(LIGHT.wrong)
        try:
            write_video(
                folder / "performance.mp4",
                performance.qpos,
                performance.pressed,
                audio,
                SAMPLE_RATE,
                colours=colours,
                progress=progress,
            )
        except RenderUnavailable as error:
            note(str(error))
    film = folder / "performance.mp4"
    progress("reporting", 0, 0)
    html = page(
        row,
        __version__,
        played=mp3(audio, SAMPLE_RATE),
        wanted=mp3(render_audio(performance.score, SAMPLE_RATE), SAMPLE_RATE),
        picture=(folder / "piano_roll.png").read_bytes(),
        dark_picture=(folder / "piano_roll_dark.png").read_bytes(),
        film=film.read_bytes() if film.exists() else None,
    )
    (folder / "report.html").write_text(html, encoding="utf-8")
    (folder / "report.json").write_text(
        json.dumps(row, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8"
    )
    return row

"""Everything that a person looks at or listens to, made from a performance."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from matplotlib.colors import to_rgb

from pianomime import __version__
from pianomime.evaluation.summary import Row, summarize
from pianomime.music import render_audio, write_wav
from pianomime.players.performance import Performance
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
"""Every file that a report may consist of; the film is the only one that may be missing."""

SAMPLE_RATE = 48_000
"""Of all sound in a report [Hz]: what the synthesizer gives without conversion."""


def write_report(
    performance: Performance,
    folder: Path,
    video: bool,
    progress: Callable[[str, int, int], None],
    note: Callable[[str], None],
) -> Row:
    """Write a report: `FILES`.

    Args:
        performance: what to report on.
        folder: where to; must exist.
        video: whether to render a film, where this machine can.
        progress: told the stage, the steps done and the steps in all (0: unknown).
        note: told, in one line, what could not be made and why.

    Returns:
        The summarize, as in `report.json`.
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
                progress=lambda done, total: progress("filming", done, total),
                colours=colours,
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

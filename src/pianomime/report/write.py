"""The report of a performance: metrics, MIDI, sound, pictures, video, and a page with all of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from pianomime import __version__
from pianomime.evaluation.summary import Row, summarize
from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score, match_notes
from pianomime.music.sound import BLOCK_SECONDS, Sound
from pianomime.music.wav import WavFile, write_wav_blocks
from pianomime.palette import DARK, LIGHT
from pianomime.players.performance import Performance
from pianomime.progress import Progress, Steps, telling
from pianomime.report.mp3 import write_mp3
from pianomime.report.page import page, source
from pianomime.report.picture import draw
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
    "performance.mp3",
    "score.mp3",
)
"""All files of a report. The film may be missing, and so may the MP3s: they are in the page, but of
a piece of more than 17 minutes."""

_SOUNDS = ("performance.mp3", "score.mp3")
_PICTURES = {"piano_roll.png": LIGHT, "piano_roll_dark.png": DARK}
_ENCODING = 3
"""Encoding a minute of sound takes as long as making it three times."""


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
        progress: called in the phases "saving", "sound", "pictures", "rendering" and "page".
        note: called with one line that says what could not be made and why.

    Returns:
        The summary, as in `report.json`.
    """
    progress("saving", 0, 0)
    row = summarize(performance)
    played = performance.played()
    performance.save(folder / "performance.npz")
    played.to_midi(folder / "performance.mid")
    with telling(progress):
        _write_sounds(played, performance.score, folder)
        steps = Steps("pictures", len(_PICTURES))
        for name, theme in _PICTURES.items():
            draw(performance, folder / name, theme)
            steps.advance(1)
    if video:
        try:
            _write_film(performance, folder, progress)
        except RenderUnavailable as error:
            note(str(error))
    film = folder / "performance.mp4"
    progress("page", 0, 0)
    sounds = [folder / name for name in _SOUNDS]
    played_mp3, wanted_mp3 = (source("audio/mpeg", sound) for sound in sounds)
    light, dark = (source("image/png", folder / name) for name in _PICTURES)
    html = page(
        row,
        __version__,
        played=played_mp3,
        wanted=wanted_mp3,
        picture=light,
        dark_picture=dark,
        film=source("video/mp4", film) if film.exists() else None,
    )
    (folder / "report.html").write_text(html, encoding="utf-8")
    for sound, address in zip(sounds, (played_mp3, wanted_mp3), strict=True):
        if address != sound.name:  # the page holds it
            sound.unlink()
    (folder / "report.json").write_text(
        json.dumps(row, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8"
    )
    return row


def _write_sounds(played: Score, wanted: Score, folder: Path) -> None:
    """Write `performance.wav`, and `_SOUNDS`, a minute at a time."""
    made, asked = Sound(played), Sound(wanted)
    # Each is made twice, see `Sound`, and encoded once.
    blocks = made.block_count + asked.block_count
    steps = Steps("sound", (2 + _ENCODING) * blocks)

    def encoded(blocks: Iterable[NDArray[np.float32]]) -> Iterator[NDArray[np.float32]]:
        for block in blocks:
            yield block
            steps.advance(_ENCODING)

    wav = folder / "performance.wav"
    write_wav_blocks(wav, made.blocks(steps.advance), 2, made.sample_rate)
    with WavFile(wav) as file:
        write_mp3(folder / _SOUNDS[0], encoded(file.blocks(BLOCK_SECONDS)), made.sample_rate)
    write_mp3(folder / _SOUNDS[1], encoded(asked.blocks(steps.advance)), asked.sample_rate)


def _write_film(performance: Performance, folder: Path, progress: Progress) -> None:
    """Write `performance.mp4`: keys are lit while they sound, phantoms in a colour of their own.

    Raises:
        RenderUnavailable: there is no working OpenGL.
    """
    played = performance.played()
    phantom = np.ones(len(played), bool)
    phantom[match_notes(performance.score, played).played] = False
    sounding, wrong = np.zeros((2, *performance.pressed.shape), bool)
    spans = np.stack([np.floor(played.onset * FRAME_RATE), np.ceil(played.offset * FRAME_RATE)])
    for note, (first, stop) in enumerate(spans.T.astype(int).tolist()):
        sounding[first:stop, played.key[note]] = True
        wrong[first:stop, played.key[note]] |= phantom[note]

    def colours(frame: int) -> NDArray[np.float32]:
        shown = key_colours(sounding[frame])
        shown[wrong[frame]] = to_rgb(LIGHT.wrong)
        return shown

    with WavFile(folder / "performance.wav") as audio:
        write_video(
            folder / "performance.mp4",
            performance.qpos,
            sounding,
            audio,
            audio.sample_rate,
            colours=colours,
            progress=progress,
        )

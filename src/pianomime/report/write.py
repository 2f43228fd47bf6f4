"""The report of a performance: metrics, MIDI, sound, pictures, video, and a page with all of it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from pianomime import __version__
from pianomime.archive import read_arrays
from pianomime.errors import InputError
from pianomime.evaluation.summary import Row, summarize
from pianomime.keyboard import KEYS
from pianomime.music import Score, match_notes
from pianomime.music.sound import BLOCK_SECONDS, Sound
from pianomime.music.wav import WavFile, write_wav_blocks
from pianomime.palette import DARK, LIGHT
from pianomime.players.motion import motion
from pianomime.players.performance import Performance
from pianomime.progress import Progress, Steps, telling
from pianomime.replay import PageMissing, Poses, page_script, write_replay
from pianomime.report.aside import Aside, CountedSteps
from pianomime.report.mp3 import write_mp3
from pianomime.report.page import REPLAY_TYPE, page, source
from pianomime.report.picture import draw
from pianomime.schema import Field
from pianomime.seal import SEAL
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
    "performance.replay.gz",
)
"""All files of a report. The film is made if asked for; the MP3s and the replay are in the page,
but of long pieces."""

_SOUNDS = ("performance.mp3", "score.mp3")
_PERFORMANCE, _FILM, _REPLAY = "performance.npz", "performance.mp4", "performance.replay.gz"
_FILM_FPS = 60
_PICTURES = {"piano_roll.png": LIGHT, "piano_roll_dark.png": DARK}
_ENCODING = 3
"""Encoding a minute of sound takes as long as making it three times."""


def write_report(
    performance: Performance,
    folder: Path,
    video: bool,
    progress: Progress,
    note: Callable[[str], None],
    keep_parts: bool = False,
    earlier: Path | None = None,
) -> Row:
    """Write the files of a report, `FILES`.

    Args:
        performance: the performance to report on.
        folder: an existing folder for the files.
        video: whether to render a film, if this machine can.
        progress: called in the phases "saving", "pictures", "sound", "rendering" and "page".
        note: called with one line that says what could not be made and why.
        keep_parts: leave sounds and replay beside the page also where it holds them.
        earlier: folder of a report that this one will replace. Its film becomes part of this one if
            it is of the same performance and none is rendered.

    Returns:
        The summary, as in `report.json`.
    """
    progress("saving", 0, 0)
    poses = Poses(performance)
    played = performance.played()
    with (
        telling(progress),
        Aside(partial(_write_sounds, played, performance.score, folder)) as sounds,
    ):
        row = summarize(performance, poses.of(motion(performance)))
        write_replay(folder / _REPLAY, performance, row, poses)
        performance.save(folder / _PERFORMANCE)
        played.to_midi(folder / "performance.mid")
        steps = Steps("pictures", len(_PICTURES))
        for name, theme in _PICTURES.items():
            draw(performance, folder / name, theme)
            steps.advance(1)
        sounds.wait("sound")
    if video:
        try:
            _write_film(performance, poses, folder, progress)
        except RenderUnavailable as error:
            note(str(error))
    film = folder / _FILM
    if earlier is not None and not film.exists():
        _keep_film(earlier, folder, note)
    progress("page", 0, 0)
    try:
        script = page_script()
    except PageMissing as error:
        script = None
        note(str(error))
    played_mp3, wanted_mp3 = (source("audio/mpeg", folder / name) for name in _SOUNDS)
    replay = source(REPLAY_TYPE, folder / _REPLAY)
    light, dark = (source("image/png", folder / name) for name in _PICTURES)
    html = page(
        row,
        __version__,
        played=played_mp3,
        wanted=wanted_mp3,
        picture=light,
        dark_picture=dark,
        film=source("video/mp4", film) if film.exists() else None,
        replay=replay,
        script=script,
    )
    (folder / "report.html").write_text(html, encoding="utf-8")
    for name, address in zip((*_SOUNDS, _REPLAY), (played_mp3, wanted_mp3, replay), strict=True):
        if address != name and not keep_parts:  # the page holds it
            (folder / name).unlink()
    (folder / "report.json").write_text(
        json.dumps(row, indent=2, ensure_ascii=False, allow_nan=False) + "\n", encoding="utf-8"
    )
    return row


def _keep_film(earlier: Path, folder: Path, note: Callable[[str], None]) -> None:
    """Take over the film of an earlier report, which takes long to render, if it is still true."""
    if not (earlier / _FILM).is_file():
        return
    if _seal(earlier / _PERFORMANCE) == _seal(folder / _PERFORMANCE):
        shutil.copy(earlier / _FILM, folder)
        note(f"{_FILM} is of this performance, and stays")
    else:
        note(f"{_FILM} was of another performance, and is removed")


def _seal(performance: Path) -> str | None:
    """The seal of a saved performance; None if there is none."""
    try:
        return str(read_arrays(performance, "a performance", {SEAL: Field("text")})[SEAL])
    except (InputError, OSError):
        return None


def _write_sounds(played: Score, wanted: Score, folder: Path, steps: CountedSteps) -> None:
    """Write `performance.wav`, and `_SOUNDS`, a minute at a time."""
    made, asked = Sound(played), Sound(wanted)
    # Each is made twice, see `Sound`, and encoded once.
    steps.total = (2 + _ENCODING) * (made.block_count + asked.block_count)

    def encoded(blocks: Iterable[NDArray[np.float32]]) -> Iterator[NDArray[np.float32]]:
        for block in blocks:
            yield block
            steps.advance(_ENCODING)

    wav = folder / "performance.wav"
    write_wav_blocks(wav, made.blocks(steps.advance), 2, made.sample_rate)
    with WavFile(wav) as file:
        write_mp3(folder / _SOUNDS[0], encoded(file.blocks(BLOCK_SECONDS)), made.sample_rate)
    write_mp3(folder / _SOUNDS[1], encoded(asked.blocks(steps.advance)), asked.sample_rate)


def _write_film(performance: Performance, poses: Poses, folder: Path, progress: Progress) -> None:
    """Write `performance.mp4`: keys are lit while they sound, phantoms in a colour of their own.

    Raises:
        RenderUnavailable: there is no working OpenGL.
    """
    played = performance.played()
    phantom = np.ones(len(played), bool)
    phantom[match_notes(performance.score, played).played] = False
    pictures = round(performance.song_seconds * _FILM_FPS)
    sounding, wrong = np.zeros((2, pictures, KEYS), bool)
    spans = np.stack([np.floor(played.onset * _FILM_FPS), np.ceil(played.offset * _FILM_FPS)])
    for note, (first, stop) in enumerate(spans.T.astype(int).tolist()):
        sounding[first:stop, played.key[note]] = True
        wrong[first:stop, played.key[note]] |= phantom[note]

    def colours(picture: int) -> NDArray[np.float32]:
        shown = key_colours(sounding[picture])
        shown[wrong[picture]] = to_rgb(LIGHT.wrong)
        return shown

    with WavFile(folder / "performance.wav") as audio:
        write_video(
            folder / _FILM,
            _FilmPoses(poses, pictures),
            sounding,
            audio,
            audio.sample_rate,
            colours=colours,
            fps=_FILM_FPS,
            progress=progress,
        )


class _FilmPoses(Sequence[NDArray[np.float64]]):
    """The joint positions in each picture of a film, found when they are asked for."""

    def __init__(self, poses: Poses, pictures: int) -> None:
        self._poses, self._pictures = poses, pictures

    def __len__(self) -> int:
        return self._pictures

    def __getitem__(self, picture: Any) -> Any:
        return self._poses.at(picture / _FILM_FPS)

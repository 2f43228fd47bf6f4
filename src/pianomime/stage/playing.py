"""What a worker process of the stage does: play a song, or prepare a saved performance."""

from __future__ import annotations

import gzip
import io
import os
import shutil
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from pianomime.file_names import file_name
from pianomime.files import staged
from pianomime.keyboard import LEAD_IN_SECONDS
from pianomime.music import Score
from pianomime.music.sound import SAMPLE_RATE, live_sound
from pianomime.players.casting import Casting
from pianomime.players.performance import Performance
from pianomime.players.registry import load_player
from pianomime.progress import no_progress
from pianomime.replay import Judgement, done_block, heard_block, notes_block, scene_block
from pianomime.replay.blocks import json_block
from pianomime.report import FILES, write_report
from pianomime.report.mp3 import Mp3
from pianomime.stage.live import LiveReplay
from pianomime.staging import claim
from pianomime.workers import Answer, Row

WORKER = "pianomime.stage.playing:load"

REPLAY, SOUND = "live.replay", "live.mp3"
"""Files in the folder of a job that grow while it goes on."""
_NAMING = "naming"
"""Stands for all reports of a stage, of which one is written at a time."""
_PATIENCE = 600.0
"""[s] for other reports to be written."""
REPORT = "report"
"""Folder in that of a job for the report of a performance that was saved before."""


def load(setup: dict[str, str]) -> Answer:
    """What answers requests, for `pianomime.workers.Worker`.

    Args:
        setup: `out`, the folder in which reports of what is played are kept.
    """
    out = Path(setup["out"])
    _warm_up()

    def answer(request: dict[str, Any]) -> Row:
        folder = Path(request["folder"])
        with WholeParts(folder / REPLAY, "wb") as replay:
            if "performance" in request:
                report = _prepare(Path(request["performance"]), folder / REPORT, replay)
            else:
                with WholeParts(folder / SOUND, "wb") as sound:
                    report = _play(request, out, replay, sound)
        return {"report": os.fspath(report)}

    return answer


def _warm_up() -> None:
    """Load what playing needs, so that a song can begin at once."""
    onset = np.array([0.5, 0.7, 0.9, 1.1])
    score = Score(np.array([40, 42, 44, 45]), onset, onset + 0.1, np.full(4, 64))
    load_player("zero-shot", effort=0).play(score)
    live_sound(score, 0.0, 1.0)
    scene_block()


def _play(request: dict[str, Any], out: Path, replay: Any, sound: Any) -> Path:
    """Play a song, and write the report; its folder."""
    casting = Casting.of(request["player"], request["effort"], 0, request["world"])
    lead_in = LEAD_IN_SECONDS if casting.takes_lead_in else 0.0
    seconds = np.inf if request["seconds"] is None else request["seconds"]
    player, score = casting.cast(Path(request["song"]), 0.0, seconds, lead_in)
    with Mp3(sound, SAMPLE_RATE) as encoder:
        live = LiveReplay(score, player, replay, encoder)
        performance = player.play(score, live.progress, live)
    judgement = Judgement.of(performance)
    replay.write(notes_block(score, performance.plan, judgement))
    replay.write(heard_block(performance.played(), 0, judgement))
    folder, row = _report_in_new_folder(performance, out, file_name(score.title))
    replay.write(done_block(row))
    return folder


def _prepare(path: Path, folder: Path, replay: Any) -> Path:
    """Write the report of a saved performance; its folder."""
    replay.write(json_block("PLAN", {"phase": "preparing", "done": 0, "total": 0}))
    _report(Performance.load(path), folder)
    with gzip.open(folder / "performance.replay.gz") as blocks:
        shutil.copyfileobj(blocks, replay)
    return folder


def _report(performance: Performance, folder: Path) -> Row:
    # What could not be made, as the script of the page, is told where the stage is started.
    with staged(folder, FILES) as inside:
        return write_report(
            performance, inside, False, no_progress, lambda _: None, keep_parts=True
        )


def _report_in_new_folder(performance: Performance, out: Path, name: str) -> tuple[Path, Row]:
    """Write a report into a folder of a name that is not taken; the folder and its row."""
    # Two of one name may come to their ends together: the other looks for a name afterwards.
    with claim(out / _NAMING, patience=_PATIENCE):
        numbers = (out / (name if number == 1 else f"{name}-{number}") for number in count(1))
        folder = next(folder for folder in numbers if not folder.exists())
        return folder, _report(performance, folder)


class WholeParts(io.FileIO):
    """A file that has each of what is written at once, and in the end whole or not at all."""

    def write(self, part: Any, /) -> int:
        """Write it; where there is no room for it, as on a full disk, nothing."""
        before, rest = self.tell(), memoryview(part)
        try:
            while len(rest):
                rest = rest[super().write(rest) :]
        except OSError:
            # Half of a block would be read as a damaged one.
            self.truncate(before)
            self.seek(before)
            raise
        return len(part)

"""Memory of `pianomime retarget` for videos of hours.

    python benchmarks/long_video.py --hours 0.5 1 4

A minute of synthetic playing (640 x 360, 20 frames/s, keys light up) is repeated, with a MIDI file
and without. MediaPipe is replaced by the positions at which the hands were drawn, so its own memory
is not measured. The whole keyboard is visible; where only a part is, and a MIDI file decides the
octave, each possible octave takes a temporary file. The peak resident memory of each length is that
of a process of its own; the video is made by another process before.
"""

from __future__ import annotations

import multiprocessing
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any
from unittest.mock import patch

import av
import numpy as np
from numpy.typing import NDArray

import common
from pianomime.keyboard import FRAME_RATE
from pianomime.music import Score
from pianomime.video import retarget as room
from pianomime.video.hands.sightings import Sighting
from pianomime.video.overlay import write_overlay
from pianomime.video.retarget import RetargetConfig, retarget
from pianomime.video.summary import write_summary

sys.path.append(str(common.ROOT / "tests"))

SIZE = (640, 360)
LOOP = 60.0


def main() -> None:
    options = common.parser("long_video", __doc__)
    options.add_argument("--hours", type=float, nargs="+", default=[0.5, 1.0])
    options.add_argument("--overlay", action="store_true", help="write the overlay, too")
    given = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for hours in given.hours:
            _alone(_make, Path(folder), hours)
            rows += [
                _alone(_retarget, Path(folder), hours, with_midi, given.overlay)
                for with_midi in (True, False)
            ]
    common.table(list(rows[0]), [list(row.values()) for row in rows])
    common.report(given.output, facts, {"long_video": rows})


def _alone(work: Callable[..., Any], *arguments: Any) -> Any:
    """The result of a function in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(work, *arguments).result()


def _make(folder: Path, hours: float) -> None:
    """Write the video, and the MIDI file of what is played in it."""
    import made_up_video as made_up

    score = made_up.song(LOOP)
    short = folder / "short.mp4"
    if not short.exists():
        plan = made_up.plan_of(score)
        made_up.write(short, made_up.camera(SIZE), SIZE, score, plan, made_up.times(LOOP, 20))
    times = round(hours * 3600 / LOOP)
    _repeat(short, folder / f"{hours}.mp4", times)
    _repeated(score, times).to_midi(folder / f"{hours}.mid")


def _retarget(folder: Path, hours: float, with_midi: bool, overlay: bool) -> dict[str, Any]:
    import made_up_video as made_up

    class Hands(made_up.TrueHands):
        """The hands of one minute, repeated."""

        def detect(self, picture: NDArray[np.uint8], milliseconds: int) -> list[Sighting]:
            return super().detect(picture, milliseconds % round(1000 * LOOP))

    video, midi, model = (folder / f"{hours}.mp4", folder / f"{hours}.mid", folder / "no.task")
    model.touch()
    points = made_up.plan_of(made_up.song(LOOP)).fingertips[: round(FRAME_RATE * LOOP), :, :, :2]
    detector = Hands(made_up.camera(SIZE), SIZE, points)
    before = _peak()
    began = time.perf_counter()
    config = RetargetConfig(midi=midi if with_midi else None, hand_model=model)
    with patch.object(room, "HandDetector", lambda _: detector):
        made = retarget(video, config)
    write_summary(made, folder / "summary.html")
    if overlay:
        write_overlay(made, folder / "overlay.mp4")
    made.demonstration.save(folder / "demo.npz")
    return {
        "hours": hours,
        "notes from": "MIDI file" if with_midi else "video",
        "notes": len(made.demonstration.score),
        "peak memory [MiB]": _peak(),
        "of that before it began [MiB]": before,
        "minutes": (time.perf_counter() - began) / 60,
    }


def _repeat(short: Path, video: Path, times: int) -> None:
    """Repeat the packets of a video, without encoding them again."""
    with av.open(str(short)) as source:
        stream = source.streams.video[0]
        packets = [packet for packet in source.demux(stream) if packet.dts is not None]
        facts = [(packet.pts, packet.dts) for packet in packets]
        length = round(LOOP / stream.time_base)
        with av.open(str(video), "w") as film:
            copy = film.add_stream_from_template(stream)
            for number in range(times):
                for packet, (pts, dts) in zip(packets, facts, strict=True):
                    packet.stream, packet.time_base = copy, stream.time_base
                    packet.pts, packet.dts = pts + number * length, dts + number * length
                    film.mux(packet)


def _repeated(score: Score, times: int) -> Score:
    late = np.repeat(np.arange(times) * LOOP, len(score))
    return Score(
        np.tile(score.key, times),
        np.tile(score.onset, times) + late,
        np.tile(score.offset, times) + late,
        np.tile(score.velocity, times),
        title="over and over",
    )


def _peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main()

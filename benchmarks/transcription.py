"""How well notes are heard in recordings, and how fast.

Transcribes the sound that our own synthesizer makes of the bundled songs and of songs of the
reference data, and a film of a person who plays, whose notes are known (PIANOMIME_SHARED names the
folder of both). F1 is that of the music protocol: onsets within 50 ms on the same key.

    python benchmarks/transcription.py
    python benchmarks/transcription.py --seconds 10 --cores 1
    python benchmarks/transcription.py --songs 0 --hand-model hand_landmarker.task

With a hand model, the film is retargeted with the notes of its sound as well, and both are timed.
"""

from __future__ import annotations

import os
import tempfile
import time
from functools import cache
from pathlib import Path
from typing import Any

import common

SECONDS = 30.0
CORES = 2
MODERN = "modern/test12"
SONGS = 12
"""The bundled songs, and as many of the modern ones as there are left."""
FILM, KNOWN = "video/films/unlit-overhead.mp4", "video/films/unlit-overhead-transcribed.mid"


def main() -> None:
    options = common.parser("transcription", __doc__)
    options.add_argument(
        "--seconds", type=float, default=SECONDS, help="of each song (%(default)s)"
    )
    options.add_argument("--cores", type=int, default=CORES, help="cores to use (%(default)s)")
    options.add_argument("--songs", type=int, default=SONGS, help="besides the film (%(default)s)")
    options.add_argument("--hand-model", type=Path, help="MediaPipe's hand_landmarker.task")
    given = options.parse_args()
    os.sched_setaffinity(0, common.cores()[: given.cores])
    # A thread that waits for another would count as work.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    # Counts the cores when it is imported.
    from pianomime import songs

    facts = common.machine()
    common.show_machine(facts)
    bundled = [songs.path(name) for name in songs.names()]
    modern = sorted((common.shared() / "data" / MODERN).glob("*.mid"))
    rows = [_synthesized(path, given.seconds) for path in (*bundled, *modern)[: given.songs]]
    film = common.shared() / "data" / FILM
    rows.append(_film(film, common.shared() / "data" / KNOWN))
    common.table(list(rows[0]), [list(row.values()) for row in rows])
    speeds = [{"command": "transcribe", "x real time": rows[-1]["x real time"]}]
    if given.hand_model is not None:
        speeds.append(_retargeted(film, given.hand_model))
    common.table(list(speeds[0]), [list(row.values()) for row in speeds])
    common.report(given.output, facts, {"cores": given.cores, "rows": rows, "speeds": speeds})


def _synthesized(path: Path, seconds: float) -> dict[str, Any]:
    """A song, made into sound by our synthesizer."""
    from pianomime.music import Score, excerpt, render_audio, write_wav

    score = excerpt(Score.from_midi(path), seconds=seconds)
    with tempfile.TemporaryDirectory() as folder:
        sound = Path(folder, f"{path.stem}.wav")
        write_wav(sound, render_audio(score))
        return {"recording": path.stem, **_heard(sound, score)}


def _film(path: Path, known: Path) -> dict[str, Any]:
    """A film, whose notes somebody else has written down."""
    from pianomime.music import Score

    return {"recording": path.stem, **_heard(path, Score.from_midi(known))}


def _retargeted(path: Path, hand_model: Path) -> dict[str, Any]:
    """How fast a demonstration is made of a film with the notes of its sound; nothing is drawn."""
    from pianomime.video.retarget import RetargetConfig, retarget

    config = RetargetConfig(hand_model=hand_model, notes="sound")
    wall = time.perf_counter()
    made = retarget(path, config, listener=_listener())
    wall = time.perf_counter() - wall
    return {"command": "retarget --notes sound", "x real time": made.film.seconds / wall}


@cache
def _listener() -> Any:
    """The network, loaded once."""
    from pianomime.transcription.listener import find_listener

    return find_listener()


def _heard(recording: Path, known: Any) -> dict[str, Any]:
    from pianomime.music import music_metrics
    from pianomime.transcription.recording import Recording
    from pianomime.transcription.transcribe import transcribe

    listener = _listener()
    given = Recording.of(recording)
    wall, cpu = time.perf_counter(), time.process_time()
    heard = transcribe(given, listener)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    metrics = music_metrics(known, heard)
    print(f"{recording.stem}: F1 {metrics.note_f1_50:.3f}", flush=True)
    return {
        "notes": len(known),
        "heard": len(heard),
        "F1 (50 ms)": metrics.note_f1_50,
        "F1 (25 ms)": metrics.note_f1_25,
        "and velocity": metrics.velocity_f1,
        "pedal lifts kept": metrics.pedal_lifts_kept,
        "seconds": given.seconds,
        "x real time": given.seconds / wall,
        "x a core's time": given.seconds / cpu,
        "doubts": len(heard.remarks),
    }


if __name__ == "__main__":
    main()

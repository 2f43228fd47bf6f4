"""Accuracy of demonstrations made from videos, against a reference made by hand and known truth.

    python benchmarks/retarget.py                    synthetic videos
    python benchmarks/retarget.py --rendered         videos of our own world (needs OpenGL)
    python benchmarks/retarget.py --reference FOLDER --hand-model FILE

FOLDER holds one video (.mp4), its MIDI file (.mid) and reference.npz: homography (3, 3) from pixels
to (x', y') with world = (-y', x'); fingertips (T, 2, 6, 3); finger_key (T, 2, 5); goal and
fingering (T, 88) with 0-4 right thumb to little finger, 5-9 left.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

import common
from pianomime import Performance, excerpt, load_player, songs
from pianomime.errors import InputError
from pianomime.keyboard import FRAME_RATE, KEYS
from pianomime.music import Score, onset_f1
from pianomime.plan.demonstration import Demonstration
from pianomime.video import retarget as room
from pianomime.video.keyboard.plane import Plane
from pianomime.video.overlay import write_overlay
from pianomime.video.retarget import RetargetConfig, retarget
from pianomime.video.summary import write_summary
from pianomime.world.parameters import key_centres

sys.path.append(str(common.ROOT / "tests"))

SMALL, LARGE, HD = (640, 360), (1280, 720), (1920, 1080)
MADE_UP: dict[str, dict[str, Any]] = {
    "24 frames/s": {"fps": 24},
    "30 frames/s": {"fps": 30},
    "60 frames/s": {"fps": 60},
    "variable rate": {"fps": 30, "seed": 3},
    "640 x 360": {"size": SMALL},
    "1920 x 1080": {"size": HD},
    "turned 4 degrees": {"view": {"turned": 4.0}},
    "mirrored": {"view": {"mirrored": True}},
    "tilted": {"view": {"tilt": 0.8}},
    "half of it seen": {"view": {"span": (-0.35, 0.25)}},
}
RENDERED = (
    "bach-prelude-c",
    "beethoven-fur-elise",
    "beethoven-ode-to-joy",
    "petzold-minuet-g",
    "twinkle-twinkle",
)
"""Bundled songs, of which the zero-shot player of frames plays 12 s."""


def main() -> None:
    options = common.parser("retarget", __doc__)
    options.add_argument("--reference", type=Path, help="folder with a video and reference.npz")
    options.add_argument("--rendered", action="store_true", help="film our own world")
    options.add_argument("--hand-model", type=Path, help="MediaPipe's hand_landmarker.task")
    given = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    results: dict[str, Any] = {}
    if given.reference:
        results["reference"] = _against_reference(given.reference, given.hand_model)
        common.table(["what", "value"], list(results["reference"].items()))
    elif given.rendered:
        rows = [_rendered(song, lit) for song in RENDERED for lit in (True, False)]
        results["rendered"] = rows
        common.table(list(rows[0]), [list(row.values()) for row in rows])
    else:
        rows = [_made_up(name, **setting) for name, setting in MADE_UP.items()]
        results["made_up"] = rows
        common.table(list(rows[0]), [list(row.values()) for row in rows])
    common.report(given.output, facts, results)


def _against_reference(folder: Path, model: Path | None) -> dict[str, Any]:
    video, midi = next(folder.glob("*.mp4")), next(folder.glob("*.mid"))
    reference = np.load(folder / "reference.npz")
    began = time.perf_counter()
    made = retarget(video, RetargetConfig(midi=midi, hand_model=model))
    with tempfile.TemporaryDirectory() as pictures:
        write_overlay(made, Path(pictures, "overlay.mp4"))
        write_summary(made, Path(pictures, "summary.html"))
    seconds = time.perf_counter() - began
    shown, quality = made.demonstration, made.demonstration.quality

    swap = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])
    known = Plane(swap @ reference["homography"])
    off = _plane_error(Plane(shown.homography), known, known.to_pixels(key_centres()[:, :2]))

    rows = len(reference["finger_key"])
    idle = reference["finger_key"] < 0
    tips = made.tracks.points[:rows, :, 1:] - reference["fingertips"][:, :, 1:, :2]

    read = retarget(video, RetargetConfig(hand_model=model)).demonstration.score
    # After the end of the MIDI file the music in the video goes on, and nothing is known of it.
    heard = read.onset <= shown.score.onset.max() + 0.1
    table: dict[str, Any] = {
        "homography, median [mm]": float(np.median(off)),
        "homography, worst [mm]": float(off.max()),
        "idle fingertips, median [mm]": 1000 * float(np.median(np.linalg.norm(tips, axis=3)[idle])),
        "fingering equal on key-frames": _equal_fingering(shown, reference),
        "both hands found before repair": float(made.tracks.found.all(axis=1).mean()),
        "offset of the MIDI file [s]": quality["offset_seconds"],
        "seconds of video a second, overlay and page too": quality["seconds"] / seconds,
        "onset F1 (100 ms) without MIDI": onset_f1(
            (shown.score.key, shown.score.onset), (read.key[heard], read.onset[heard]), 0.1
        ),
    }
    for rule in ("steady", "paper"):
        if rule == "paper":
            config = RetargetConfig(midi=midi, hand_model=model, align="paper")
            shown = retarget(video, config).demonstration
        for name, effort, feasible in (
            ("demonstration-ik", 0, False),
            ("demonstration", 0, False),
            ("demonstration", 1, False),
            ("demonstration", 0, True),
            ("demonstration", 1, True),
        ):
            settings = {"planner.feasible": feasible} if name == "demonstration" else {}
            player = load_player(name, effort, demonstration=shown, **settings)
            f1 = player.play(shown.score).metrics()["f1"]
            tips = "made feasible" if feasible else "as recorded"
            table[f"F1, {name}, effort {effort}, {tips}, --align {rule}"] = f1
    return table


def _equal_fingering(shown: Demonstration, reference: Any) -> float:
    """Share of the reference's key-frames in which a note has the same finger."""
    goal, wanted = reference["goal"], reference["fingering"]
    # The reference's own grid: notes are matched by key and nearest onset.
    notes = Score.from_roll(goal)
    equal = total = 0
    spans = notes.note_frames()
    for key, (first, end) in zip(notes.key, spans, strict=True):
        mine = np.flatnonzero(shown.score.key == key)
        nearest = mine[np.abs(shown.score.onset[mine] - first / FRAME_RATE).argmin()]
        finger = shown.plan.note_finger[nearest] + 5 * (shown.plan.note_hand[nearest] == 0)
        cells = wanted[first:end, key]
        total += len(cells)
        equal += int((cells == finger).sum())
    return equal / total


def _plane_error(plane: Plane, known: Plane, pixels: np.ndarray) -> np.ndarray:
    """[mm] between what two planes make of pixels."""
    error: np.ndarray = 1000 * np.linalg.norm(
        plane.to_world(pixels) - known.to_world(pixels), axis=1
    )
    return error


def _made_up(
    name: str,
    size: tuple[int, int] = LARGE,
    fps: float = 30,
    seed: int | None = None,
    view: dict[str, Any] | None = None,
) -> dict[str, Any]:
    import made_up_video as made_up

    score = made_up.song(8.0)
    plan = made_up.plan_of(score)
    plane = made_up.camera(size, **(view or {}))
    late = 0.7
    with tempfile.TemporaryDirectory() as folder:
        video, midi, model = (Path(folder, each) for each in ("v.mp4", "s.mid", "m.task"))
        made_up.write(video, plane, size, score, plan, made_up.times(8.0, fps, seed))
        score.clip(late, 99.0).to_midi(midi)
        model.write_bytes(b"not used")

        def detector(_: Path) -> made_up.TrueHands:
            return made_up.TrueHands(plane, size, plan.fingertips[..., :2])

        with patch.object(room, "HandDetector", detector):
            made = retarget(video, RetargetConfig(midi=midi, hand_model=model))
            read = retarget(video, RetargetConfig(hand_model=model)).demonstration.score
    pixels = plane.to_pixels(key_centres()[:, :2])
    visible = ((pixels >= 0) & (pixels < size)).all(axis=1)
    shown = made.demonstration
    off = _plane_error(Plane(shown.homography), plane, pixels[visible])
    rows = min(len(plan), len(made.tracks))
    tips = made.tracks.points[:rows, :, 1:] - plan.fingertips[:rows, :, 1:, :2]
    count = min(len(plan), len(shown.plan))
    pressed = (plan.finger_key[:count] >= 0) & (shown.plan.finger_key[:count] >= 0)
    same = plan.finger_key[:count] == shown.plan.finger_key[:count]
    # Without a MIDI file half a keyboard may be read an octave off.
    best = max(
        onset_f1(
            (score.key, score.onset),
            (moved.key, moved.onset),
            0.1,
        )
        for shift in (-24, -12, 0, 12, 24)
        if (moved := _moved(read, shift)) is not None
    )
    return {
        "video": name,
        "homography, median [mm]": float(np.median(off)),
        "worst [mm]": float(off.max()),
        "offset off by [ms]": 1000 * abs(shown.quality["offset_seconds"] - late),
        "fingertips, median [mm]": 1000 * float(np.median(np.linalg.norm(tips, axis=3))),
        "same finger": float(same[pressed].mean()),
        "onset F1 without MIDI": best,
    }


def _rendered(song: str, lit: bool) -> dict[str, Any]:
    import rendered_video

    performance = _performance(song)
    played = performance.played()
    with tempfile.TemporaryDirectory() as folder:
        video, midi, model = (Path(folder, each) for each in ("v.mp4", "s.mid", "m.task"))
        rendered_video.write(video, performance, lit)
        played.to_midi(midi)
        model.touch()
        hands = rendered_video.hands(performance)
        with patch.object(room, "HandDetector", lambda _: hands):
            made = retarget(video, RetargetConfig(midi=midi, hand_model=model))
            read = _read(video, model)
    plane = rendered_video.camera()
    pixels = plane.to_pixels(key_centres()[:, :2])
    off = _plane_error(Plane(made.demonstration.homography), plane, pixels)
    return {
        "song": song,
        "keys that are down": "light up" if lit else "only go down",
        "homography, median [mm]": float(np.median(off)),
        "worst [mm]": float(off.max()),
        "offset off by [ms]": 1000 * abs(made.demonstration.quality["offset_seconds"]),
        "notes": len(played),
        "read without MIDI": 0 if read is None else len(read),
        "onset F1 without MIDI": onset_f1(
            (played.key, played.onset),
            ([], []) if read is None else (read.key, read.onset),
            0.1,
        ),
    }


def _read(video: Path, model: Path) -> Score | None:
    """The notes read from a video, if its keys light up."""
    try:
        return retarget(video, RetargetConfig(hand_model=model)).demonstration.score
    except InputError:
        return None


@cache
def _performance(song: str) -> Performance:
    score = excerpt(Score.from_midi(songs.path(song)), seconds=12)
    return load_player("zero-shot-20hz", 0).play(score)


def _moved(score: Score, semitones: int) -> Score | None:
    key = score.key + semitones
    return replace(score, key=key) if len(key) and key.min() >= 0 and key.max() < KEYS else None


if __name__ == "__main__":
    main()

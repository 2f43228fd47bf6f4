"""Sizes and rates stand in keyboard.py and world/layout.py; elsewhere their names are used."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "pianomime"

FORBIDDEN = {
    88: "keyboard.KEYS",
    46: "LAYOUT.ctrl_size",
    54: "LAYOUT.hands_size",
    142: "LAYOUT.qpos_size",
    21: "keyboard.LOWEST_PITCH",
    27: "LAYOUT.hand_joints",
    23: "LAYOUT.hand_actuators",
    36: "layout.POINTS_SIZE",
    0.05: "keyboard.FRAME_SECONDS",
    20: "keyboard.FRAME_RATE",
    30: "keyboard.EXCERPT_SECONDS, or layout.TIPS_SIZE",
}
"""Numbers, also as floats, and the names to use instead."""

HOME = ("keyboard.py", "world/layout.py")
"""The files that give these numbers their names."""

OTHER_NUMBERS = ("world/scene_look.py",)
"""Files of positions [m] and colours, in which such a number means nothing else."""

ALLOWED = {
    # Lengths [m].
    ("learn/envs/observation.py", "_ERROR_UNIT = 0.05"),
    ("learn/envs/reward.py", "TIP_BOUND, TIP_MARGIN = 0.01, 0.05"),
    ("plan/hand_path.py", "alike_wrist: float = 0.05"),
    ("policies/finger_residual.py", "_DEPTH = 0.05"),
    ("policies/three_stage/hand_controls.py", "_LENGTH = 0.05"),
    ("policies/three_stage/hand_motion.py", "_LENGTH = 0.05"),
    ("world/perturbation.py", "_FAR_ASIDE = 0.05"),
    ("track/dynamic.py", "_WRIST_TOLERANCE = 0.05"),
    ("track/keystroke.py", "_WRIST_TOLERANCE = 0.05"),
    ("video/hands/repair.py", "[0.01, -0.05]"),
    ("video/hands/tracks.py", "_SAME_HAND = 0.05"),
    ("video/keyboard/refine.py", "[[0, -0.1], [-0.05, 0]]"),
    ("video/notes/key_light.py", '"between the black keys": (-0.050, -0.040)'),
    # Frames ahead, and keys aside.
    ("policies/three_stage/fingering.py", "_AHEAD = (0, 1,"),
    ("policies/three_stage/fingering.py", "_REACH = 20"),
    ("policies/three_stage/hand_motion.py", "_AHEAD = (0, 1,"),
    # Angles [rad] and accelerations [m/s^2].
    ("plan/joint_path.py", '"WRJ1": -0.05'),
    ("plan/joint_path.py", '"LFJ5": 0.05'),
    ("track/sampling/note_sampling.py", "wrist: float = 0.05"),
    ("plan/hand_path.py", "slide_acceleration=20.0"),
    # Steps of brightness, of 255, angles of hues [degrees], and counts of white keys.
    ("video/notes/lit.py", "_COLOURFUL = 30.0"),
    ("video/notes/lit.py", "_GAIN = 20.0"),
    ("video/notes/lit.py", "_SAME_HUE = 20.0"),
    (
        "video/keyboard/naming.py",
        "_SIZES = ((0, len(WHITES), 0.0), (9, 36,",
    ),
    # Times that have nothing to do with frames [s].
    ("music/metrics.py", "ONSET_TOLERANCE = 0.05"),
    ("music/protocol.py", "onset_tolerances: tuple[float, ...] = (0.050"),
    ("music/protocol.py", "offset_least: float = 0.050"),
    ("music/protocol.py", "pedal: float = 0.050"),
    ("songs/notation.py", "RELEASE = 0.05"),
    ("media/sound.py", "_JITTER = 0.05"),
    ("track/sampling/note_cost.py", "_OPEN = 0.05"),
    ("commands/progress.py", "_LINE_SECONDS = 30.0"),
    ("evaluation/robust_grid.py", "Perturbation(delay=0.05)"),
    # Shares, probabilities and costs.
    ("evaluation/diagnose.py", "_TOUCHED = 0.05"),
    ("learn/envs/reward.py", "KEY_BOUND, KEY_MARGIN = 0.05"),
    ("video/hands/tracks.py", "FEWEST = 0.05"),
    ("video/hands/tracks.py", "math.log(min(max(likely, 0.05), 0.95))"),
    ("video/notes/fingers.py", "_WORST = 20.0"),
    ("video/notes/key_light.py", "_NEAR = 0.05"),
    ("video/parallax.py", "_MOST_STRETCH = 0.05"),
    # Counts of other things: bits, steps, updates, frames, notes, landmarks, pictures a second.
    ("archive.py", "_BLOCK = 1 << 20"),
    ("music/midi.py", "_MOST_BYTES = 8 << 20"),
    ("music/midi.py", "_MOST_BYTES >> 20"),
    ("video/hands/model.py", "_LARGEST = 64 << 20"),
    # Addresses of a synthesizer, the quality of a film, a share of a second.
    ("music/midi_channels.py", "part, 0x15, mode"),
    ("mp4.py", "crf: int = 20"),
    ("learn/fingers/training.py", "_CHECKPOINT_UPDATES = 20"),
    ("policies/methods.py", "Sampler(20)"),
    ("video/film/film.py", "_USUAL_RATE = 30.0"),
    ("video/hands/detector.py", "_LANDMARKS = [0, 4, 8, 12, 16, 20]"),
    ("video/notes/key_light.py", "_FEWEST = 20"),
    ("video/parallax.py", "_FEWEST = 20"),
}
"""(file, part of the line): lines in which such a number is the size of something else."""


def bare_numbers(text: str) -> Iterator[tuple[int, str, str]]:
    """Line number, line and name to use of every forbidden number in Python code."""
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            name = FORBIDDEN.get(node.value)
            if name is not None:
                yield node.lineno, lines[node.lineno - 1].strip(), name


def source_files() -> list[str]:
    """All files of the package that must not hold such numbers."""
    files = (file.relative_to(SOURCE).as_posix() for file in SOURCE.rglob("*.py"))
    return sorted(name for name in files if name not in (*HOME, *OTHER_NUMBERS))


@pytest.mark.parametrize("name", source_files())
def test_sizes_and_rates_have_names(name: str) -> None:
    allowed = [part for file, part in ALLOWED if file == name]
    found = [
        f"{name}:{number}: {line} (use {instead})"
        for number, line, instead in bare_numbers((SOURCE / name).read_text("utf-8"))
        if not any(part in line for part in allowed)
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(("name", "part"), sorted(ALLOWED))
def test_every_exception_is_needed(name: str, part: str) -> None:
    text = (SOURCE / name).read_text("utf-8")
    assert any(part in line for _, line, _ in bare_numbers(text))


def test_what_is_found() -> None:
    code = "a = 88\nb = (1, 46.0, -0.05)\nc = '142 (T, 88)'  # 54\nd = True\n"
    assert [(number, name) for number, _, name in bare_numbers(code)] == [
        (1, "keyboard.KEYS"),
        (2, "LAYOUT.ctrl_size"),
        (2, "keyboard.FRAME_SECONDS"),
    ]

"""Plans and controls as they are now, for tests that notice any change of them.

Made anew by `python benchmarks/digest.py --write`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from common import ROOT
from pianomime import Score, World, excerpt, songs
from pianomime.archive import write_arrays
from pianomime.files import atomic
from pianomime.plan import ZeroShotPlanner
from pianomime.plan.fingering import find_fingering
from pianomime.plan.hand_path import make_feasible
from pianomime.plan.joint_path import smooth_path
from pianomime.players import rollout
from pianomime.track import DynamicTracker, IkTracker
from pianomime.world.hand import Hand

FINGERINGS = ROOT / "tests" / "plan" / "fingerings.npz"
CONTROLS = ROOT / "tests" / "track" / "controls.npz"
SONG, SECONDS = "beethoven-fur-elise", 4.0
HUMAN = np.array([0.01, -0.004, 0.02])
"""[m] How far the fingertips of a made-up human are from the robot's."""


def write_plans() -> None:
    """Fingerings of bundled songs and of music for more than ten fingers; controls of one plan."""
    arrays: dict[str, Any] = {}
    scores = {
        name: excerpt(Score.from_midi(songs.path(name)), seconds=12.0) for name in songs.names()
    }
    scores |= {f"dense {seed}": _dense(seed) for seed in range(4)}
    for name, score in scores.items():
        fingering = find_fingering(score)
        arrays[f"{name}: notes"] = np.stack([score.key, score.onset, score.offset])
        arrays[f"{name}: fingering"] = np.stack(
            [fingering.hand, fingering.finger, fingering.start, fingering.stop]
        ).astype(np.int16)
    _write(FINGERINGS, arrays)

    score = excerpt(Score.from_midi(songs.path(SONG)), seconds=SECONDS)
    plan = ZeroShotPlanner().plan(score)
    controller, world = DynamicTracker().start(plan), World()
    rest = world.qpos.copy()
    after = [world.qpos.copy() for _ in rollout(controller, world, score.pedal_roll())]
    frames, qpos = np.arange(len(plan)), np.array([rest, *after[:-1]])
    human = make_feasible(replace(plan, fingertips=plan.fingertips + HUMAN))
    _write(
        CONTROLS,
        {
            "fingertips": plan.fingertips,
            "finger_key": plan.finger_key,
            "qpos": qpos,
            "dynamic": controller.controls(frames, qpos)[0],
            "ik": IkTracker().start(plan).controls(frames, qpos)[0],
            "path": right_path(plan.fingertips),
            "feasible": human.fingertips,
        },
    )


def right_path(fingertips: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T + 1, 27) Joints of the right hand that follows points (T, 2, 6, 3), as they are set."""
    points = fingertips[:, 1] + [0.0, 0.0, 0.03]
    clearance = np.full((len(points), 5), 0.01)
    weights = np.full(points.shape, 250.0)
    return smooth_path(Hand("rh"), np.zeros(27), points, weights, clearance)


def _dense(seed: int) -> Score:
    """Notes that two hands cannot play all of: some are cut, late or left out."""
    rng = np.random.default_rng(seed)
    count = 60
    onset = np.sort(rng.integers(2, 120, count)) / 20.0
    key = rng.integers(18, 70, count)
    return Score(key, onset, onset + rng.integers(2, 24, count) / 20.0, np.full(count, 64))


def _write(path: Path, arrays: dict[str, Any]) -> None:
    with atomic(path) as temporary:
        write_arrays(temporary, arrays)

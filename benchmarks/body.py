"""How people's hands move, and those of performances, by the body metrics.

Needs the reference data (PIANOMIME_SHARED names its folder). Measured are

- human: wrist speed and jerks of the human demonstrations, which are fingertips seen in videos.
  Their fingertips are put onto the keys that they press, which adds to the jerk of these.
- experts: overlaps, speeds and jerks of the recorded poses of the paper's experts, which were
  trained to follow these demonstrations.
- each performance.npz that is named.

`HUMAN` in `pianomime.players.body` holds the first row. Clips with faults in their source are left
out.
"""

from __future__ import annotations

import math
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

import common
from fidelity import clips
from pianomime.keyboard import KEYS
from pianomime.players.body import (
    OVERLAP_DEPTH,
    BodyMetrics,
    body_metrics,
    wrist_and_fingertip_motion,
)
from pianomime.players.performance import Performance
from pianomime.world.hand import hand_points
from pianomime.world.overlap import overlap

Row = dict[str, float | None]


def together(parts: list[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Arrays one after the other, with a frame between them that does not count."""
    gap = [np.full((1, *part.shape[1:]), 0.0) for part in parts]
    rows = np.concatenate([piece for pair in zip(parts, gap, strict=True) for piece in pair])
    counts = np.concatenate([np.append(np.ones(len(part), bool), False) for part in parts])
    return rows, counts


def human(shared: Path) -> Row:
    """Wrist speed and jerks of the human demonstrations."""
    with np.load(shared / "data" / "pianomime" / "demonstrations.npz") as file:
        fingertips, length, odd = (file[name] for name in ("fingertips", "length", "odd"))
    ends = np.cumsum(length)
    return wrist_and_fingertip_motion(
        *together(
            [
                fingertips[end - count : end].astype(float)
                for end, count, wrong in zip(ends, length, odd, strict=True)
                if not wrong
            ]
        )
    )


def experts(shared: Path, every: int) -> Row:
    """What recorded poses can tell, of every so many clips."""
    poses = [clip.qpos[:, KEYS:] for clip in track([*clips(shared, every)], "experts")]
    joints, counts = together(poses)
    deep = overlap(joints[counts])
    points = hand_points(joints)
    wrists = points[counts, :, 0, 1]
    fingers = deep.fingers.max(axis=1)
    return {
        "hands_overlap": float((deep.hands > OVERLAP_DEPTH).mean()),
        "hands_overlap_max": float(deep.hands.max()),
        "fingers_overlap": float((fingers > OVERLAP_DEPTH).mean()),
        "fingers_overlap_max": float(fingers.max()),
        "forearms_crossed": float((wrists[:, 0] > wrists[:, 1]).mean()),
        **wrist_and_fingertip_motion(points, counts),
    }


def main() -> None:
    options = common.parser("body", __doc__)
    options.add_argument("performances", nargs="*", type=Path, help="files performance.npz")
    options.add_argument("--every", type=int, default=1, help="take every so many experts' clips")
    arguments = options.parse_args()
    shared = common.shared()
    facts = common.machine()
    common.show_machine(facts)
    columns: dict[str, Row] = {"human": human(shared), "experts": experts(shared, arguments.every)}
    for path in arguments.performances:
        measured = asdict(body_metrics(Performance.load(path)))
        columns[path.parent.name or path.stem] = measured
    names = [field.name for field in fields(BodyMetrics) if field.name != "invalid"]
    rows = [[name, *(_number(column.get(name)) for column in columns.values())] for name in names]
    common.table(["metric", *columns], rows)
    common.report(arguments.output, facts, {"body": columns})


def _number(value: float | None) -> float:
    return math.nan if value is None else value


if __name__ == "__main__":
    main()

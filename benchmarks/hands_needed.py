"""What hands would need to move as those of performances did: range, speed, torque or force.

Performances are played again and watched at every physics step. Of a group of joints a row has the
widest range of one joint, and the greatest and the 99th percentile of speeds and efforts over all
joints and steps. Efforts are those of the actuators; an acceleration is a change of speed from one
step to the next, over its time. `some_joint_over_hand_speed` is the share of steps in which a joint
of wrists or fingers is faster than Shadow Robot allows it to be (`limits.hand_speeds`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import common
from pianomime.export.joints import Joints, effort_unit
from pianomime.export.limits import hand_speeds
from pianomime.export.samples import PHYSICS_RATE, Samples, samples
from pianomime.players.performance import Performance
from pianomime.world.model import world_model

GROUPS = {
    "forearm along the keyboard": "forearm_tx",
    "forearm toward the piano": "forearm_ty",
    "forearm up and down": "forearm_tz",
    "wrist": "WRJ[12]",
    "fingers sideways, J4": "[FMRL]FJ4",
    "knuckles, J3": "[FMRL]FJ3",
    "middle joints, J2": "[FMRL]FJ2",
    "last joints, J1": "[FMRL]FJ1",
    "palm, LFJ5": "LFJ5",
    "thumb": "THJ[1-5]",
}
"""Groups of joints, by what their names are without the side."""


def joined(blocks: Sequence[Samples]) -> Samples:
    """Samples of a whole performance."""
    return Samples(*(np.concatenate(each) for each in zip(*blocks, strict=True)))


def columns(joints: Joints, pattern: str) -> NDArray[np.int64]:
    """Places of the joints of a group."""
    return np.flatnonzero([bool(re.fullmatch(f"[rl]h_{pattern}", name)) for name in joints.names])


def needed(joints: Joints, pattern: str, played: Sequence[Samples]) -> dict[str, Any]:
    """The row of a group."""
    group = columns(joints, pattern)
    position = np.concatenate([each.position[:, group] for each in played])
    row: dict[str, Any] = {"unit": joints.units[group[0]], "range": np.ptp(position, axis=0).max()}
    for name in ("velocity", "effort"):
        size = np.abs(np.concatenate([getattr(each, name)[:, group] for each in played]))
        row |= {f"{name}_p99": np.percentile(size, 99), f"{name}_max": size.max()}
    return {name: value if name == "unit" else float(value) for name, value in row.items()}


def main() -> None:
    options = common.parser("hands_needed", __doc__)
    options.add_argument("performances", nargs="+", type=Path, help="files performance.npz")
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    performances = [Performance.load(path) for path in arguments.performances]
    worlds = sorted({performance.world for performance in performances})
    if len(worlds) > 1:
        raise SystemExit(f"performances of several worlds: {', '.join(worlds)}")
    joints = Joints.of(world_model(worlds[0]))
    played = [joined(list(samples(each, PHYSICS_RATE))) for each in performances]
    rows = {label: needed(joints, pattern, played) for label, pattern in GROUPS.items()}
    rails = columns(joints, "forearm_t[xyz]")
    change = max(np.abs(np.diff(each.velocity[:, rails], axis=0)).max() for each in played)
    hinges, speeds = columns(joints, "(?!forearm).*"), hand_speeds(joints)
    too_fast = {
        f"{path.parent.name}/{path.stem}": float(
            (np.abs(each.velocity[:, hinges]) > speeds[hinges]).any(axis=1).mean()
        )
        for path, each in zip(arguments.performances, played, strict=True)
    }
    found = {
        "world": worlds[0],
        "seconds": sum(each.song_seconds for each in performances),
        "forearm_acceleration_max": float(change * PHYSICS_RATE),
        "some_joint_over_hand_speed": too_fast,
    }
    common.table(
        ["joints", "range", "speed p99", "speed max", "effort p99", "effort max", "units"],
        [
            [label, *list(row.values())[1:], f"{row['unit']}, /s, {effort_unit(row['unit'])}"]
            for label, row in rows.items()
        ],
    )
    print(found)
    common.report(arguments.output, facts, {**found, "joints": rows})


if __name__ == "__main__":
    main()

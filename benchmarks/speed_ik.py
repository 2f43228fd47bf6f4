"""Time of a tracker per frame: the paper's IK, and the dynamic tracker.

The zero-shot planner's fingertips of a bundled song are tracked in a World, on one core. The time
of `start`, divided by the frames, and that of every `control` is measured, without the World's
steps.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import common
from pianomime.keyboard import FRAME_SECONDS
from pianomime.music import Score
from pianomime.music.excerpt import excerpt
from pianomime.plan import FingertipPlan, ZeroShotPlanner
from pianomime.songs.find import find_song
from pianomime.track import DynamicTracker, IkTracker, Tracker
from pianomime.world import World

TRACKERS: dict[str, Callable[[], Tracker]] = {"ik": IkTracker, "dynamic": DynamicTracker}


def measure(tracker: Tracker, plan: FingertipPlan) -> dict[str, float]:
    """Milliseconds per frame of one tracker."""
    world = World()
    start = time.perf_counter()
    controller = tracker.start(plan)
    starting = time.perf_counter() - start
    control = np.empty(len(plan))
    for frame in range(len(plan)):
        start = time.perf_counter()
        ctrl = controller.control(frame, world)
        control[frame] = time.perf_counter() - start
        world.step(ctrl)
    each = starting / len(plan) + control.mean()
    return {
        "start_ms": 1e3 * starting / len(plan),
        "control_ms_median": 1e3 * float(np.median(control)),
        "control_ms_99": 1e3 * float(np.percentile(control, 99)),
        "control_ms_slowest": 1e3 * float(control.max()),
        "together_ms": 1e3 * each,
        "realtime_factor": FRAME_SECONDS / each,
    }


def main() -> None:
    options = common.parser("speed_ik", __doc__)
    options.add_argument("--song", default="beethoven-fur-elise", help="bundled song or MIDI file")
    options.add_argument("--rounds", type=int, default=5)
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    os.sched_setaffinity(0, {max(common.cores())})
    plan = ZeroShotPlanner().plan(excerpt(Score.from_midi(find_song(arguments.song))))
    runs: dict[str, list[dict[str, float]]] = {name: [] for name in TRACKERS}
    for _ in range(arguments.rounds):
        for name, make in TRACKERS.items():
            runs[name].append(measure(make(), plan))
    medians: dict[str, Any] = {
        name: {each: float(np.median([run[each] for run in ran])) for each in ran[0]}
        for name, ran in runs.items()
    }
    print(
        f"{arguments.song}: {len(plan)} frames, both hands, median of {arguments.rounds} rounds\n"
    )
    common.table(
        (
            "tracker",
            "start [ms/frame]",
            "control, median [ms]",
            "99 %",
            "slowest",
            "together [ms/frame]",
            "times real time",
        ),
        [(name, *row.values()) for name, row in medians.items()],
    )
    common.report(
        arguments.output,
        facts,
        {"song": arguments.song, "frames": len(plan), "median": medians, "rounds": runs},
    )


if __name__ == "__main__":
    main()

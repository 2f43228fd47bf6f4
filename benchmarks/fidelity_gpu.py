"""Fidelity of worlds stepped by MuJoCo Warp, by recordings of the paper's experts.

Needs the reference data (PIANOMIME_SHARED names its folder) and the extra gpu. The recorded
controls of clips are replayed open loop from the rest pose, as `benchmarks/fidelity.py` does, in
three batches with a world for each clip: the world as it is, in MuJoCo; MuJoCo with the options
that Warp simulates (`world.warp_physics`), which separates what these change from what Warp does;
and Warp.

Measured are precision, recall and F1 of the keys pressed, blow-ups, how far the joints of the hands
are from those of MuJoCo after some control steps, and the key-frames, of those that are pressed in
either, in which they differ. All clips on a GPU, and in MuJoCo alone:

    python benchmarks/fidelity_gpu.py --device cuda
    python benchmarks/fidelity_gpu.py --device cpu
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

import common
from fidelity import Clip, clips
from pianomime.device_names import CPU, DEVICES
from pianomime.music import frame_metrics
from pianomime.world.batch_base import WorldBatchBase
from pianomime.world.device_batch import check_device, device_batch
from pianomime.world.model import world_model
from pianomime.world.warp_physics import warp_physics

_COMPARED = (1, 12, 100)
"""Control steps after which positions are compared."""
_PERCENTILES = (50, 99, 100)


def controls_of(played: list[Clip]) -> NDArray[np.float64]:
    """(T, B, 46) Controls of all clips; those of shorter ones hold their last."""
    longest = max(len(clip.ctrl) for clip in played)
    return np.stack(
        [np.pad(clip.ctrl, ((0, longest - len(clip.ctrl)), (0, 0)), "edge") for clip in played],
        axis=1,
    )


def replay(
    batch: WorldBatchBase, controls: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], dict[int, NDArray[np.float64]], float]:
    """Keys pressed (T, B, 88), joints of the hands (B, 54) after some steps, and seconds taken."""
    pressed, joints, start = [], {}, time.perf_counter()
    for number, ctrl in enumerate(controls, 1):
        batch.step(ctrl)
        pressed.append(batch.pressed)
        if number in _COMPARED:
            joints[number] = batch.qpos_hands
    return np.array(pressed), joints, time.perf_counter() - start


def main() -> None:
    options = common.parser("fidelity_gpu", __doc__)
    options.add_argument("--device", choices=DEVICES, default="cuda")
    options.add_argument("--every", type=int, default=1, help="take every so many clips")
    arguments = options.parse_args()
    check_device(arguments.device)
    facts = common.machine()
    played = list(clips(common.shared(), arguments.every))
    controls = controls_of(played)
    model = world_model()
    batches = {
        "MuJoCo, the world": device_batch(len(played), quiet=True),
        "MuJoCo, options of Warp": device_batch(len(played), quiet=True, model=warp_physics(model)),
    }
    if arguments.device != CPU:
        batches[f"Warp, {arguments.device}"] = device_batch(
            len(played), arguments.device, quiet=True
        )
    runs = {name: replay(batch, controls) for name, batch in batches.items()}
    print(f"{len(played)} clips, {sum(len(clip.ctrl) for clip in played)} control steps")
    results = {}
    for name, (pressed, joints, seconds) in runs.items():
        metrics = [
            frame_metrics(clip.goal, pressed[: len(clip.ctrl), world])
            for world, clip in enumerate(played)
        ]
        row = {
            "f1": float(np.mean([one.f1 for one in metrics])),
            "worst_f1": min(one.f1 for one in metrics),
            "precision": float(np.mean([one.precision for one in metrics])),
            "recall": float(np.mean([one.recall for one in metrics])),
            "blow_ups": int(batches[name].blow_ups.sum()),
            "seconds": seconds,
        }
        print(
            f"\n{name}: replay F1 {row['f1']:.4f} (worst {row['worst_f1']:.3f}), "
            f"precision {row['precision']:.4f}, recall {row['recall']:.4f}, "
            f"blow-ups {row['blow_ups']}, {seconds:.0f} s"
        )
        for other, (theirs, their_joints, _) in runs.items():
            if other == name:
                break
            either = sum(
                int((pressed | theirs)[: len(clip.ctrl), world].sum())
                for world, clip in enumerate(played)
            )
            differ = sum(
                int((pressed ^ theirs)[: len(clip.ctrl), world].sum())
                for world, clip in enumerate(played)
            )
            print(f"  to {other}: {differ} of {either} key-frames differ; joints [rad, m]")
            compared = {}
            for steps in joints:
                error = np.abs(joints[steps] - their_joints[steps])
                median, most, largest = np.percentile(error, _PERCENTILES)
                print(
                    f"    after {steps:3} control steps: median {median:.1e}, "
                    f"99 % below {most:.1e}, largest {largest:.1e}"
                )
                compared[steps] = [float(median), float(most), float(largest)]
            row[f"to {other}"] = {"differ": differ, "either": either, "joints": compared}
        results[name] = row
    common.report(arguments.output, facts, {"clips": len(played), "results": results})


if __name__ == "__main__":
    main()

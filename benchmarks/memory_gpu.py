"""Memory of many worlds on a GPU, and how much of the room for contacts they use.

Needs the extra gpu. Memory is the most that Warp held at once while the worlds were made and took
a control step: their arrays, and those that a physics step allocates and frees. Warp counts what it
allocates itself, on `warp-cpu` as on a GPU; its kernels, and what the driver takes, come on top.

Room: the most rows of constraints of one world, and the most contacts and pairs of near geometries
as means over the worlds, with random controls over the actuators' whole ranges, in both worlds.

    python benchmarks/memory_gpu.py --device cuda
"""

from __future__ import annotations

import multiprocessing
from typing import Any

import numpy as np

import common
from pianomime.device_names import DEVICES, DeviceName
from pianomime.world.device_batch import check_device, device_batch
from pianomime.world_names import WORLDS

_MEBI = 1024**2
_ROOM_WORLDS, _ROOM_STEPS = 8, 20


def memory(device: DeviceName, worlds: int) -> int:
    """The most bytes that Warp held at once for some worlds; in a process of its own."""
    # What is compiled and loaded once is no memory of worlds.
    device_batch(1, device, quiet=True)
    import warp

    with warp.ScopedMemoryTracker("worlds", report_func=lambda text: None):
        batch: Any = device_batch(worlds, device, quiet=True)
        batch.step(np.zeros((worlds, batch.model.nu)))
    # The report has it rounded, and as text.
    return int(warp._src.context.runtime.core.wp_alloc_tracker_get_peak_bytes())


def room(device: DeviceName, world: str) -> dict[str, float]:
    """What random controls use of the room in a world."""
    rng = np.random.default_rng(0)
    batch: Any = device_batch(_ROOM_WORLDS, device, quiet=True, model=world)
    low, high = batch.model.actuator_ctrlrange.T
    used = {"rows of constraints": 0.0, "near pairs": 0.0, "contacts": 0.0}
    for _ in range(_ROOM_STEPS):
        batch.step(rng.uniform(low, high, (_ROOM_WORLDS, batch.model.nu)))
        for name, found in (
            ("rows of constraints", batch._data.nefc.numpy().max()),
            ("near pairs", batch._data.ncollision.numpy()[0] / _ROOM_WORLDS),
            ("contacts", batch._data.nacon.numpy()[0] / _ROOM_WORLDS),
        ):
            used[name] = max(used[name], float(found))
    used["blow-ups"] = float(batch.blow_ups.sum())
    return used


def main() -> None:
    options = common.parser("memory_gpu", __doc__)
    options.add_argument("--device", choices=DEVICES[1:], default="cuda")
    options.add_argument("--worlds", type=int, nargs="+", default=[256, 1024, 4096])
    arguments = options.parse_args()
    check_device(arguments.device)
    facts = common.machine()
    taken = {}
    for worlds in arguments.worlds:
        with multiprocessing.get_context("spawn").Pool(1) as process:
            taken[worlds] = process.apply(memory, (arguments.device, worlds))
        print(
            f"{worlds} worlds: {taken[worlds] / _MEBI:.0f} MiB, "
            f"{taken[worlds] / worlds / _MEBI:.2f} each"
        )
    used = {world: room(arguments.device, world) for world in WORLDS}
    for world, numbers in used.items():
        print(f"{world}: " + ", ".join(f"{name} {most:.1f}" for name, most in numbers.items()))
    common.report(arguments.output, facts, {"bytes": taken, "room": used})


if __name__ == "__main__":
    main()

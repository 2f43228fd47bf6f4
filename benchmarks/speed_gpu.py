"""Control steps per second of many worlds on a GPU.

Needs the extra gpu. A control step is 0.05 s, ten physics steps; those of all worlds are counted.
Worlds follow `workload.waving`, hands that swing and press keys, each from elsewhere in it. Timed
are, for each number of worlds:

- step: `WarpBatch.step` alone, which copies key events and what broke, and no more
- step and read: the same, then the positions, the velocities and the key states
- environment: `SongBatch.step` of a bundled song without residuals: besides the physics, the base
  controller and the observations, which are computed on the processor
- all but physics: the same, without the time in which the worlds are stepped: no environment can
  be quicker, however quick the GPU is
- make: the first step included, which compiles kernels where none are cached

Parity is the largest difference of the joints to MuJoCo with the same options, after some control
steps. Memory: `benchmarks/memory_gpu.py`.

    python benchmarks/speed_gpu.py --device cuda
    python benchmarks/speed_gpu.py --device warp-cpu --worlds 16 --steps 5
    python benchmarks/speed_gpu.py --device cpu --worlds 256 --steps 20      # to compare
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

import common
import workload
from pianomime.device_names import DEVICES
from pianomime.keyboard import FRAME_SECONDS
from pianomime.world import World, WorldBatch
from pianomime.world.device_batch import check_device, device_batch
from pianomime.world.warp_physics import warp_physics

_APPROACH = 20
"""Control steps before those that are timed: at rest nothing touches, which looks too quick."""
_PARITY = (1, 12)


def elsewhere(controls: NDArray[np.float64], worlds: int) -> NDArray[np.float64]:
    """(T, B, 46) Controls of worlds, each of which is elsewhere in (T, 46)."""
    shifts = np.linspace(0, len(controls), worlds, endpoint=False).astype(int)
    return np.stack([np.roll(controls, -shift, axis=0) for shift in shifts], axis=1)


def measure(device: Any, worlds: int, controls: NDArray[np.float64]) -> dict[str, Any]:
    """One number of worlds."""
    together = elsewhere(controls, worlds)
    start = time.perf_counter()
    batch = device_batch(worlds, device, quiet=True)
    batch.step(together[0])
    result: dict[str, Any] = {"make_s": time.perf_counter() - start}
    for ctrl in together[1:_APPROACH]:
        batch.step(ctrl)
    rates = {}
    for name in ("step", "step and read"):
        start = time.perf_counter()
        for ctrl in together[_APPROACH:]:
            batch.step(ctrl)
            if name != "step":
                _ = batch.qpos_hands, batch.qvel_hands, batch.key_state, batch.pressed
        timed = time.perf_counter() - start
        rates[name] = worlds * len(together[_APPROACH:]) / timed
    return result | {"rates": rates, "blow_ups": int(batch.blow_ups.sum())}


def environment(device: Any, worlds: int, song: str, steps: int) -> dict[str, float]:
    """Steps per second of an environment without residuals; its episodes begin anew when over."""
    from pianomime.learn.envs.batch import SongBatch
    from pianomime.learn.envs.config import EnvConfig
    from pianomime.learn.envs.reference import load_demonstration

    batch = SongBatch(load_demonstration(song), EnvConfig(device=device), num_envs=worlds)
    rng = np.random.default_rng(0)
    batch.reset(rng)
    action = np.zeros((worlds, batch.action_size))
    batch.step(action)
    physics, step = 0.0, batch._worlds.step

    def timed(*arguments: Any) -> None:
        nonlocal physics
        begin = time.perf_counter()
        step(*arguments)
        physics += time.perf_counter() - begin

    stepping: Any = batch._worlds
    stepping.step = timed
    start = time.perf_counter()
    for _ in range(steps):
        if batch.step(action).terminated.any():
            batch.reset(rng)
    taken = time.perf_counter() - start
    return {
        "environment": worlds * steps / taken,
        "all but physics": worlds * steps / (taken - physics),
    }


def parity(device: Any, controls: NDArray[np.float64]) -> dict[int, float]:
    """Largest difference of the hands' joints to MuJoCo with the same options [rad, m]."""
    worlds = 4
    batch = device_batch(worlds, device, quiet=True)
    reference = WorldBatch(worlds, quiet=True, model=warp_physics(batch.model))
    found = {}
    for number, ctrl in enumerate(elsewhere(controls, worlds)[: max(_PARITY)], 1):
        batch.step(ctrl)
        reference.step(ctrl)
        if number in _PARITY:
            found[number] = float(np.abs(batch.qpos_hands - reference.qpos_hands).max())
    return found


def main() -> None:
    options = common.parser("speed_gpu", __doc__)
    options.add_argument("--device", choices=DEVICES, default="cuda")
    options.add_argument("--worlds", type=int, nargs="+", default=[256, 1024, 4096])
    options.add_argument("--steps", type=int, default=100, help="control steps that are timed")
    options.add_argument("--song", default="ode-to-joy", help="of the environment")
    arguments = options.parse_args()
    check_device(arguments.device)
    facts = common.machine()
    common.show_machine(facts)
    model = World().model
    names = [model.actuator(index).name for index in range(model.nu)]
    controls = workload.waving(names, _APPROACH + arguments.steps, FRAME_SECONDS)
    near = parity(arguments.device, controls)
    for steps, error in near.items():
        print(f"parity after {steps} control steps: {error:.1e} rad or m at most")
    results = {}
    for worlds in arguments.worlds:
        result = measure(arguments.device, worlds, controls)
        result["rates"] |= environment(arguments.device, worlds, arguments.song, arguments.steps)
        results[worlds] = result
        rates = ", ".join(f"{name} {rate:.0f}/s" for name, rate in result["rates"].items())
        print(
            f"\n{worlds} worlds, made in {result['make_s']:.1f} s: {rates}; "
            f"blow-ups {result['blow_ups']}"
        )
    common.report(arguments.output, facts, {"parity": near, "worlds": results})


if __name__ == "__main__":
    main()

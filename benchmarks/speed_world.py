"""Control steps per second of World, WorldBatch and RoboPianist.

All simulate the same scene with the same controls, in turns and in several rounds, so that other
work of the machine affects them alike; medians are reported. A control step is 0.05 s, ten physics
steps. Workloads: `waving`, hands that swing and press keys; `song`, the controls of a zero-shot
performance of a bundled song; and, where PIANOMIME_SHARED names a folder with
`data/pianomime/experts.npz`, `expert`, the recorded controls of trained experts. Timed are, all but
WorldBatch on one core:

- World: `World.step`, then reading the hands' positions, the key states and the pressed keys
- World, step only: `World.step` alone
- WorldBatch: its step, on all cores; steps of all its worlds are counted
- RoboPianist: `env.step` of its own environment, that is physics, observations and reward
- RoboPianist, physics only: plain `mj_step` on RoboPianist's own compiled model, in its MuJoCo

RoboPianist (1.0.10, in MuJoCo 3.3.7) runs in a Python environment of its own, which
`benchmarks/install_robopianist.py` makes; without it, only World and WorldBatch are timed. The
options of PianoMime's published code make its scene the same as that of World. Pressed keys and
contacts are counted in both, to show that both do the same work.
"""

from __future__ import annotations

import os
import statistics
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import common
import workload
from pianomime import load_player
from pianomime.keyboard import FRAME_SECONDS
from pianomime.world import World, WorldBatch
from robopianist_peer import RobopianistPeer

_BATCH_APPROACH = 20
_BATCH_SHORTER = 4
Controls = NDArray[np.float64]


class LeftOutError(Exception):
    """A workload cannot be run here; the message says why."""


class Peer(RobopianistPeer):
    """RoboPianist, given the same controls."""

    def __init__(self, python: Path, controls: Controls, extra: list[str]) -> None:
        self._folder = tempfile.TemporaryDirectory()
        file = Path(self._folder.name, "controls.npy")
        np.save(file, controls)
        super().__init__(python, "robopianist_worker.py", str(file), *extra)

    def time(self, mode: str) -> float:
        """Seconds that all controls take in a mode."""
        return float(self.ask(mode)["seconds"])

    def close(self) -> None:
        """End the process."""
        super().close()
        self._folder.cleanup()


def run_world(controls: Controls, read: bool) -> float:
    """Seconds that one World takes."""
    world = World()
    start = time.perf_counter()
    for control in controls:
        world.step(control)
        if read:
            _ = world.qpos_hands, world.key_state, world.pressed
    return time.perf_counter() - start


def census(controls: Controls) -> dict[str, float]:
    """Mean keys pressed and contacts in World, and how often its physics broke."""
    world = World()
    pressed, contacts = [], []
    for control in controls:
        world.step(control)
        pressed.append(world.pressed.sum())
        contacts.append(world.data.ncon)
    return {
        "keys_pressed": float(np.mean(pressed)),
        "contacts": float(np.mean(contacts)),
        "blow_ups": world.blow_ups,
    }


def batch_runner(controls: Controls, worlds: int, threads: int) -> tuple[Callable[[], float], int]:
    """A run of WorldBatch, and the steps that it counts: each world is elsewhere in the controls.

    It is shorter than the others', as it does the work of many.
    """
    shifts = np.linspace(0, len(controls), worlds, endpoint=False).astype(int)
    together = np.stack([np.roll(controls, -shift, axis=0) for shift in shifts], axis=1)
    together = together[: _BATCH_APPROACH + len(controls) // _BATCH_SHORTER]

    def run() -> float:
        batch = WorldBatch(worlds, threads)
        # From the rest pose to where the hands play: nothing touches, so it would look too quick.
        for control in together[:_BATCH_APPROACH]:
            batch.step(control)
        start = time.perf_counter()
        for control in together[_BATCH_APPROACH:]:
            batch.step(control)
        return time.perf_counter() - start

    return run, worlds * (len(together) - _BATCH_APPROACH)


def song_controls(name: str) -> Controls:
    """The controls of a zero-shot performance, one a frame."""
    from pianomime.music import Score
    from pianomime.music.excerpt import excerpt
    from pianomime.songs.find import find_song

    score = excerpt(Score.from_midi(find_song(name)))
    controls: Controls = load_player("zero-shot-20hz").play(score).ctrl[:, 0]
    return controls


def expert_controls(steps: int) -> Controls:
    """The controls of the first recorded expert clips."""
    shared = os.environ.get("PIANOMIME_SHARED")
    if not shared:
        raise LeftOutError("PIANOMIME_SHARED is not set")
    file = Path(shared, "data", "pianomime", "experts.npz")
    if not file.exists():
        raise LeftOutError(f"there is no {file}")
    with np.load(file) as recorded:
        controls: Controls = recorded["ctrl_1e4"][:steps] / 1e4
    return controls


def measure(
    controls: Controls, rounds: int, worlds: int, peer_python: Path | None, extra: list[str]
) -> dict[str, Any]:
    """All contestants in turns on one workload."""
    everywhere = os.sched_getaffinity(0)
    core = max(everywhere)
    steps = len(controls)
    result: dict[str, Any] = {"control_steps": steps, "census": {"World": census(controls)}}
    contestants: dict[str, tuple[Callable[[], float], int]] = {
        "World": (lambda: run_world(controls, read=True), steps),
        "World, step only": (lambda: run_world(controls, read=False), steps),
    }
    batch_name = f"WorldBatch of {worlds}, {len(everywhere)} threads"
    contestants[batch_name] = batch_runner(controls, worlds, len(everywhere))
    peer = Peer(peer_python, controls, extra) if peer_python else None
    try:
        if peer is not None:
            peer.pin(core)
            result["peer"] = peer.facts
            result["census"]["RoboPianist"] = peer.ask("census")
            for name, mode in (
                ("RoboPianist", "environment"),
                ("RoboPianist, physics only", "physics"),
            ):
                contestants[name] = (partial(peer.time, mode), steps)
        rates: dict[str, list[float]] = {name: [] for name in contestants}
        for _ in range(rounds):
            for name, (run, counted) in contestants.items():
                os.sched_setaffinity(0, everywhere if name == batch_name else {core})
                rates[name].append(counted / run())
    finally:
        os.sched_setaffinity(0, everywhere)
        if peer is not None:
            peer.close()
    medians = {name: statistics.median(rate) for name, rate in rates.items()}
    result |= {"rates": rates, "median": medians, "ratios": ratios(medians, batch_name)}
    return result


def ratios(medians: dict[str, float], batch: str) -> dict[str, float]:
    """The comparisons that matter, of those that were measured."""
    pairs = {
        "World / RoboPianist": ("World", "RoboPianist"),
        "World / RoboPianist, physics only on both": (
            "World, step only",
            "RoboPianist, physics only",
        ),
        "WorldBatch / World, step only": (batch, "World, step only"),
        "WorldBatch / RoboPianist": (batch, "RoboPianist"),
    }
    return {
        name: medians[one] / medians[other]
        for name, (one, other) in pairs.items()
        if one in medians and other in medians
    }


def main() -> None:
    options = common.parser("speed_world", __doc__)
    options.add_argument("--rounds", type=int, default=9)
    options.add_argument("--steps", type=int, default=400, help="control steps a round")
    options.add_argument("--worlds", type=int, default=16, help="worlds in the batch")
    options.add_argument("--song", default="beethoven-fur-elise", help="bundled song or MIDI file")
    options.add_argument(
        "--peer-python",
        type=Path,
        default=common.ROOT / ".cache" / "robopianist" / "bin" / "python",
        help="RoboPianist's Python (%(default)s)",
    )
    options.add_argument(
        "--primitive-tips",
        action="store_true",
        help="let RoboPianist replace its fingertip meshes by capsules, which is faster",
    )
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    peer_python: Path | None = arguments.peer_python
    if peer_python is not None and not peer_python.exists():
        print(f"RoboPianist is left out: no {peer_python}; run benchmarks/install_robopianist.py\n")
        peer_python = None
    model = World().model
    names = [model.actuator(index).name for index in range(model.nu)]
    steps = arguments.steps
    workloads: dict[str, Callable[[], Controls]] = {
        "waving": lambda: workload.waving(names, steps, FRAME_SECONDS),
        "song": lambda: song_controls(arguments.song)[:steps],
        "expert": lambda: expert_controls(steps),
    }
    results: dict[str, Any] = {}
    for name, make in workloads.items():
        try:
            controls = make()
        except (ImportError, LeftOutError) as missing:
            print(f"\n{name} is left out: {missing}")
            continue
        result = measure(
            controls,
            arguments.rounds,
            arguments.worlds,
            peer_python,
            ["--primitive-tips"] if arguments.primitive_tips else [],
        )
        results[name] = result
        show(name, result)
    common.report(arguments.output, facts, {"workloads": results})


def show(name: str, result: dict[str, Any]) -> None:
    print(f"\n{name}: {result['control_steps']} control steps of {FRAME_SECONDS} s\n")
    common.table(
        ("what", "control steps/s (median)", "slowest round", "fastest round"),
        [
            (what, result["median"][what], min(rates), max(rates))
            for what, rates in result["rates"].items()
        ],
    )
    print()
    common.table(
        ("mean over the run", "keys pressed", "contacts"),
        [(who, c["keys_pressed"], c["contacts"]) for who, c in result["census"].items()],
    )
    print()
    common.table(("ratio of medians", ""), list(result["ratios"].items()))


if __name__ == "__main__":
    main()

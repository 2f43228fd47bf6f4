"""Steps per second: the vector environment alone, and PPO end to end, beside RoboPianist.

RoboPianist runs in Stable-Baselines3's SubprocVecEnv, in a Python of its own that
`benchmarks/install_robopianist.py --learning` makes; without it, only our environment is timed. The
two are run in turns for several rounds, so that other work on the machine slows both alike, and
medians are compared. PPO has the network and the batch of the paper (table 6); a step is 0.05 s of
playing in one environment. Ours is the `paper` preset with its inverse kinematics, which
RoboPianist does not compute.
"""

from __future__ import annotations

import statistics
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import common
from pianomime.learn.envs.batch import SongBatch
from pianomime.learn.envs.reference import load_demonstration
from pianomime.learn.envs.sb3_env import Sb3Env
from pianomime.learn.expert.config import PpoConfig, preset_config
from pianomime.learn.expert.ppo import make_model
from robopianist_peer import RobopianistPeer


class Peer(RobopianistPeer):
    """RoboPianist and Stable-Baselines3."""

    def __init__(self, python: Path, *arguments: int) -> None:
        super().__init__(python, "robopianist_sb3.py", *map(str, arguments))

    def rate(self, mode: str) -> float:
        """Steps a second in a mode."""
        answer = self.ask(mode)
        return float(answer["steps"] / answer["seconds"])


class Ours:
    """The `paper` preset on a bundled song."""

    def __init__(self, song: str, envs: int, steps: int, ppo: PpoConfig) -> None:
        config = replace(preset_config("paper"), ppo=ppo)
        self._vec = Sb3Env(SongBatch(load_demonstration(song), config.env, envs))
        self._vec.reset()
        rng = np.random.default_rng(0)
        size = self._vec.batch.action_size
        self._actions = rng.uniform(-1, 1, (steps, envs, size)).astype(np.float32) * 0.1
        self._model = make_model(self._vec, ppo, 0, len(common.cores()))
        self._update = ppo.steps_per_update
        self.facts = {"observations": self._vec.batch.observer.size, "actions": size}

    def rate(self, mode: str) -> float:
        """Steps a second in a mode."""
        start = time.perf_counter()
        if mode == "environment":
            for action in self._actions:
                self._vec.step(action)
            return float(self._actions[..., 0].size / (time.perf_counter() - start))
        self._model.learn(self._update)
        return self._update / (time.perf_counter() - start)

    def close(self) -> None:
        """Nothing is left open."""
        self._vec.close()


def main() -> None:
    options = common.parser("speed_learn", __doc__)
    options.add_argument("--rounds", type=int, default=5)
    options.add_argument("--envs", type=int, default=32)
    options.add_argument("--steps", type=int, default=60, help="of each environment, a round")
    options.add_argument("--update", type=int, default=8192, help="steps between PPO's updates")
    options.add_argument("--song", default="beethoven-fur-elise", help="bundled song or file")
    options.add_argument(
        "--peer-python",
        type=Path,
        default=common.ROOT / ".cache" / "robopianist" / "bin" / "python",
        help="RoboPianist's Python (%(default)s)",
    )
    arguments = options.parse_args()
    facts = common.machine()
    common.show_machine(facts)
    ppo = PpoConfig(num_envs=arguments.envs, steps_per_update=arguments.update)
    sides: dict[str, Ours | Peer] = {
        "ours": Ours(arguments.song, arguments.envs, arguments.steps, ppo)
    }
    if arguments.peer_python.exists():
        sides["RoboPianist"] = Peer(
            arguments.peer_python,
            arguments.envs,
            arguments.steps,
            ppo.steps_per_update,
            ppo.batch_size,
            len(common.cores()),
        )
    else:
        print(f"RoboPianist is left out: no {arguments.peer_python}\n")
    rates: dict[str, dict[str, list[float]]] = {
        mode: {who: [] for who in sides} for mode in ("environment", "ppo")
    }
    for _ in range(arguments.rounds):
        for mode, found in rates.items():
            for who, side in sides.items():
                found[who].append(side.rate(mode))
    for side in sides.values():
        side.close()
    rows = []
    for mode, found in rates.items():
        for who, values in found.items():
            rows.append((mode, who, statistics.median(values), min(values), max(values)))
    common.table(("what", "who", "steps/s (median)", "slowest round", "fastest round"), rows)
    ratios = {
        mode: statistics.median(found["ours"]) / statistics.median(found["RoboPianist"])
        for mode, found in rates.items()
        if "RoboPianist" in found
    }
    if ratios:
        print()
        common.table(("ours / RoboPianist", ""), list(ratios.items()))
    sizes = {who: side.facts for who, side in sides.items()}
    common.report(arguments.output, facts, {"rates": rates, "ratios": ratios, "sizes": sizes})


if __name__ == "__main__":
    main()

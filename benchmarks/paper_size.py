"""Networks of the paper's size on this machine: what an update takes, and whether files are true.

For each policy: a few updates with the paper's batch, through the same trainer as `pianomime
train`; the time of an update is the median. Memory is the most that the process held, with the data
set, the averages of the weights and the optimizer. Then the policy is written as ONNX, run by ONNX
Runtime, and compared with the network that was trained: the largest difference of an output,
relative to the largest output. Weights are almost those that they began with, so how well it plays
is not asked; the goal encoder is untrained.

    python benchmarks/paper_size.py DATA.zarr        # as `pianomime perform` makes them
"""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import common

_NAMES = ("high-diff", "low-diff", "high-bet", "low-bet")
_FIT, _COMPARED = 512, 16
"""Samples that normalizers are fitted to, and on which outputs are compared."""
_FEWEST = 3
"""Updates: the first one warms up, and the last one ends with the training."""
_KIBI, _MEBI = 2**10, 2**20


def one(name: str, data: str, updates: int) -> dict[str, Any]:
    """The measurements of a policy; in a process of its own."""
    import torch

    from pianomime.learn.data.dataset import (
        DEMONSTRATION_COLUMNS,
        TRAJECTORY_COLUMNS,
        trajectory_dataset,
    )
    from pianomime.learn.goal.autoencoder import GoalEncoder
    from pianomime.learn.imitation.config import policy_config
    from pianomime.learn.imitation.export import export_policy, policy_info, torch_policy
    from pianomime.learn.imitation.network import PolicyNetwork
    from pianomime.learn.imitation.samples import Samples
    from pianomime.learn.runs.trainer import train_network
    from pianomime.policies.network_file import load_policy

    config = policy_config(name, "paper")  # type: ignore[arg-type]
    trainer = replace(config.trainer, steps=updates)
    columns = DEMONSTRATION_COLUMNS if config.level == "high" else TRAJECTORY_COLUMNS
    samples = Samples.of(trajectory_dataset([Path(data)], columns), config)
    drawn = samples.draw(np.random.default_rng(0), _FIT)
    encoder = GoalEncoder() if config.goal_encoding == "sdf" else None
    network = PolicyNetwork(config, {key: each.shape[1:] for key, each in drawn.items()}, encoder)
    network.fit_normalizers(drawn)
    times: list[float] = []
    threads: list[int] = []

    def loss(module: Any, batch: Any) -> Any:
        """Called once an update."""
        times.append(time.perf_counter())
        threads.append(torch.get_num_threads())
        return module(batch)

    with tempfile.TemporaryDirectory() as folder:
        train_network(Path(folder, name), network, loss, samples.draw, trainer)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _KIBI
        file = Path(folder, f"{name}.onnx")
        export_policy(network, policy_info(network, name), file)
        observation = {
            key: each[:_COMPARED]
            for key, each in drawn.items()
            if key in ("goal", "frames", "vector")
        }
        trained, written = (
            policy.act(observation, np.random.default_rng(0))
            for policy in (torch_policy(network, name), load_policy(file))
        )
        size = file.stat().st_size
    return {
        "policy": name,
        "millions": sum(each.numel() for each in network.parameters()) / 1e6,
        "batch": trainer.batch,
        "seconds": float(np.median(np.diff(times)[1:])),
        "updates": config.trainer.steps,
        "peak_mib": peak / _MEBI,
        "file_mib": size / _MEBI,
        "difference": float(np.abs(trained - written).max() / np.abs(trained).max()),
        "threads": threads[0],
    }


def main() -> None:
    """Measure, print and write."""
    options = common.parser("paper_size", __doc__)
    options.add_argument("data", help="data set of trajectories")
    options.add_argument("--updates", type=int, default=4, help="of each network (%(default)s)")
    given = options.parse_args()
    if given.updates < _FEWEST:
        options.error(f"--updates must be {_FEWEST} or more")
    facts, rows = common.machine(), []
    common.show_machine(facts)
    for name in _NAMES:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rows.append(pool.apply(one, (name, given.data, given.updates)))
    days = 3600 * 24
    common.table(
        ("policy", "parameters [M]", "batch", "s an update", "updates of the paper", "days of them",
         "peak [MiB]", "file [MiB]", "file against network"),
        [
            (
                row["policy"], f"{row['millions']:.1f}", row["batch"], f"{row['seconds']:.2f}",
                row["updates"], f"{row['seconds'] * row['updates'] / days:.1f}",
                f"{row['peak_mib']:.0f}", f"{row['file_mib']:.0f}", f"{row['difference']:.1e}",
            )
            for row in rows
        ],
    )  # fmt: skip
    common.report(given.output, facts, {"networks": rows})


if __name__ == "__main__":
    main()

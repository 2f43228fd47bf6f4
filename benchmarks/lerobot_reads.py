"""LeRobot reads an export of `pianomime export-data`, and one of its policies trains on it.

Run it with the Python of an environment in which `lerobot` is installed; PianoMime need not be:

    python benchmarks/lerobot_reads.py out/piano --policy act --steps 20

It loads the folder as a LeRobotDataset, gets every item, compares what comes with `meta/`, and
trains the policy on one batch, whose loss must fall. Anything that is not as it should be ends it
with an error. It reaches for no network.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
from typing import Any

os.environ.setdefault("HF_HUB_OFFLINE", "1")

import numpy as np
import torch
from lerobot.datasets.factory import resolve_delta_timestamps
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.policies.factory import make_policy, make_policy_config, make_pre_post_processors

REPOSITORY = "local/piano"
"""A name that LeRobot wants; nothing of it is on the hub."""
SMALL: dict[str, dict[str, Any]] = {
    "act": {
        "dim_model": 64,
        "n_heads": 4,
        "dim_feedforward": 128,
        "chunk_size": 16,
        "n_action_steps": 16,
    },
    "diffusion": {"down_dims": (64, 128), "horizon": 16},
}
"""Settings of policies that train on a processor in seconds."""
BATCH = 32
"""Items in the batch."""
RATE = 1e-3
"""Learning rate; all weights are trained alike."""


def check_items(folder: Path) -> None:
    """Get every item, and compare with what the metadata say."""
    data = LeRobotDataset(REPOSITORY, root=folder)
    items = [data[index] for index in range(len(data))]
    assert len(items) == data.meta.total_frames
    for index, item in enumerate(items):
        episode = data.meta.episodes[int(item["episode_index"])]
        assert episode["dataset_from_index"] <= index < episode["dataset_to_index"]
        assert [item["task"]] == episode["tasks"]
    for name in ("observation.state", "observation.environment_state", "action"):
        values = np.stack([item[name].numpy() for item in items]).astype(float)
        stats, feature = data.meta.stats[name], data.meta.features[name]
        assert values.shape[1:] == tuple(feature["shape"]) == (len(feature["names"]),)
        np.testing.assert_allclose(values.mean(0), stats["mean"], atol=1e-6)
        np.testing.assert_allclose(values.std(0), stats["std"], atol=1e-6)
        np.testing.assert_array_equal(values.max(0), stats["max"])
        print(f"{name}: {values.shape[1]} numbers in {len(values)} frames")
    print(f"{data.meta.total_episodes} episodes, tasks: {', '.join(data.meta.tasks.index)}")
    one = LeRobotDataset(REPOSITORY, root=folder, episodes=[1])
    assert {int(each["episode_index"]) for each in (one[0], one[len(one) - 1])} == {1}


def train(folder: Path, name: str, steps: int) -> None:
    """Train a policy on one batch."""
    torch.manual_seed(0)
    config = make_policy_config(name, device="cpu", push_to_hub=False, **SMALL[name])
    meta = LeRobotDataset(REPOSITORY, root=folder).meta
    data = LeRobotDataset(
        REPOSITORY, root=folder, delta_timestamps=resolve_delta_timestamps(config, meta)
    )
    policy = make_policy(config, ds_meta=meta)
    before, _ = make_pre_post_processors(config, dataset_stats=meta.stats)
    batch = before(next(iter(torch.utils.data.DataLoader(data, BATCH, shuffle=True))))
    optimizer = torch.optim.AdamW(policy.parameters(), lr=RATE)
    losses = []
    policy.train()
    for _ in range(steps):
        loss, _ = policy.forward(batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    weights = sum(each.numel() for each in policy.parameters())
    print(f"{name}, {weights} weights: loss {losses[0]:.3f}, after {steps} steps {losses[-1]:.3f}")
    if not losses[-1] < losses[0]:
        raise SystemExit(f"{name} does not learn")


def main() -> None:
    """Check what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="an export for LeRobot")
    parser.add_argument("--policy", choices=[*SMALL], nargs="*", default=[*SMALL])
    parser.add_argument("--steps", type=int, default=20)
    arguments = parser.parse_args()
    check_items(arguments.folder)
    for name in arguments.policy:
        train(arguments.folder, name, arguments.steps)


if __name__ == "__main__":
    main()

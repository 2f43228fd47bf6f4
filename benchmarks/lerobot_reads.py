"""LeRobot reads an export of `pianomime export-data`, and one of its policies trains on it.

Run it with the Python of an environment in which `lerobot` is installed; PianoMime need not be:

    python benchmarks/lerobot_reads.py out/piano --policy act --steps 20

It loads the folder as a LeRobotDataset, gets every item, compares what comes with `meta/`, and
trains the policy on one batch, whose loss must fall. If there are pictures, `--pianomime PYTHON`
names a Python that has PianoMime, which renders some states once more: of all pictures that of the
same item must be as near as any. Anything that is not as it should be ends it with an error.
It reaches for no network.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
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
        # Of the network that sees pictures: they would have to be loaded.
        "pretrained_backbone_weights": None,
    },
    "diffusion": {"down_dims": (64, 128), "horizon": 16},
}
"""Settings of policies that train on a processor in seconds."""
BATCH = 32
"""Items in the batch."""
RATE = 1e-3
"""Learning rate; all weights are trained alike."""
LOSSES = 0.05
"""By which statistics of pictures may differ after compression; they are within 0..1."""
RENDER = """
import sys
import numpy as np
from pianomime.keyboard import KEYS
from pianomime.world.parameters import key_travel
from pianomime.world.render import render_frame
from pianomime.world.state import pressed

states = np.load(sys.argv[1])
hands = (states.shape[1] - KEYS) // 2
qpos = np.hstack([states[:, -KEYS:] * key_travel(), states[:, :hands]])
height, width, camera = int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
made = [render_frame(each, pressed(each), width, height, camera) for each in qpos]
np.save(sys.argv[1], np.stack(made))
"""
"""Makes pictures of states (T, 196), in the file that has these."""
NEAREST = 1.05
"""Times the distance of the nearest picture: of hands that hardly move the compression decides."""
SHOWN = 12
"""States that are rendered: a renderer is opened for each."""


def check_items(folder: Path, decoder: str | None, python: str | None) -> None:
    """Get every item, and compare with what the metadata say."""
    data = LeRobotDataset(REPOSITORY, root=folder, video_backend=decoder)
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
    for name in data.meta.video_keys:
        pictures = np.stack([item[name].numpy() for item in items])
        check_pictures(data, name, pictures)
        if python:
            states = np.stack([item["observation.state"].numpy() for item in items])
            check_poses(data, name, pictures, states, python)
    print(f"{data.meta.total_episodes} episodes, tasks: {', '.join(data.meta.tasks.index)}")
    one = LeRobotDataset(REPOSITORY, root=folder, episodes=[1], video_backend=decoder)
    assert {int(each["episode_index"]) for each in (one[0], one[len(one) - 1])} == {1}


def check_pictures(data: LeRobotDataset, name: str, pictures: np.ndarray) -> None:
    """Compare the pictures (T, 3, height, width), 0..1, with what the metadata say of them."""
    stats, (height, width, colours) = data.meta.stats[name], data.meta.features[name]["shape"]
    assert pictures.shape[1:] == (colours, height, width)
    assert stats["count"] == [len(pictures)]
    for stat, found in (("mean", pictures.mean((0, 2, 3))), ("std", pictures.std((0, 2, 3)))):
        assert stats[stat].shape == (colours, 1, 1)
        np.testing.assert_allclose(found, stats[stat].ravel(), atol=LOSSES)
    print(f"{name}: {len(pictures)} pictures of {width}x{height}, by {data.video_backend}")


def check_poses(
    data: LeRobotDataset, name: str, pictures: np.ndarray, states: np.ndarray, python: str
) -> None:
    """Render some states again: of all pictures that of the same item must be as near as any."""
    height, width, _ = data.meta.features[name]["shape"]
    at = np.unique(np.linspace(0, len(states) - 1, SHOWN).astype(int))
    with tempfile.TemporaryDirectory() as home:
        file = Path(home, "states.npy")
        np.save(file, states[at].astype(float))
        camera = name.rpartition(".")[2]
        command = [python, "-c", RENDER, str(file), str(height), str(width), camera]
        subprocess.run(command, check=True)
        rendered = np.load(file).transpose(0, 3, 1, 2) / 255
    apart = np.array([np.abs(pictures - each).mean((1, 2, 3)) for each in rendered])
    own = apart[np.arange(len(at)), at]
    assert (own <= NEAREST * apart.min(1)).all(), (at, apart.argmin(1))
    print(f"{name}: {len(at)} states rendered again are {own.max():.4f} of 1 apart at most")


def train(folder: Path, name: str, steps: int, decoder: str | None) -> None:
    """Train a policy on one batch."""
    torch.manual_seed(0)
    config = make_policy_config(name, device="cpu", push_to_hub=False, **SMALL[name])
    meta = LeRobotDataset(REPOSITORY, root=folder).meta
    data = LeRobotDataset(
        REPOSITORY,
        root=folder,
        delta_timestamps=resolve_delta_timestamps(config, meta),
        video_backend=decoder,
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
    parser.add_argument("--decoder", help="of videos: torchcodec or pyav")
    parser.add_argument("--pianomime", metavar="PYTHON", help="renders states once more")
    arguments = parser.parse_args()
    check_items(arguments.folder, arguments.decoder, arguments.pianomime)
    for name in arguments.policy:
        train(arguments.folder, name, arguments.steps, arguments.decoder)


if __name__ == "__main__":
    main()

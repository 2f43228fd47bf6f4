"""Minari reads an export of `pianomime export-data --format minari`, episode by episode.

Run it with the Python of an environment in which `minari[hdf5]` is installed; PianoMime need not
be:

    python benchmarks/minari_reads.py out/piano-v0

Anything that is not as Minari has it ends the program with an error.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np


def check(folder: Path) -> None:
    """Load the data set by its name, and check every step against its spaces."""
    os.environ["MINARI_DATASETS_PATH"] = str(folder.resolve().parent)
    # Only now: it looks for the folder of data sets when it is imported.
    import minari
    from gymnasium.spaces.utils import flatten, flatten_space

    data = minari.load_dataset(folder.name)
    assert folder.name in minari.list_local_datasets()
    flat, steps = flatten_space(data.observation_space), 0
    facts_of_all = data.storage.get_episode_metadata(data.episode_indices)
    for episode, facts in zip(data, facts_of_all, strict=True):
        assert repr(episode)
        for at in range(len(episode) + 1):
            observation = {name: array[at] for name, array in episode.observations.items()}
            assert data.observation_space.contains(observation)
            assert flatten(data.observation_space, observation) in flat
        assert all(data.action_space.contains(action) for action in episode.actions)
        assert episode.truncations.tolist() == [False] * (len(episode) - 1) + [True]
        assert ((episode.rewards >= 0) & (episode.rewards <= 1)).all()
        print(f"{facts['name']}: {len(episode)} steps, mean reward {np.mean(episode.rewards):.3f}")
        steps += len(episode)
    assert steps == data.total_steps
    train, rest = minari.split_dataset(data, sizes=[1, len(data) - 1], seed=0)
    assert len(train) + len(rest) == len(data)
    print(f"Minari {minari.__version__}: {len(data)} episodes, {steps} steps")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path, help="an export for Minari")
    check(parser.parse_args().folder)

from __future__ import annotations

from pathlib import Path

import numpy as np

from pianomime.archive import read_arrays, write_arrays


def test_arrays_come_back(tmp_path: Path) -> None:
    """What is longer than a block, lies the other way round, is one number, a text, or nothing."""
    arrays = {
        "long": np.random.default_rng(0).normal(size=(3, 100_000)),
        "turned": np.arange(6, dtype=np.int8).reshape(2, 3).T,
        "some": np.arange(10)[::3],
        "number": np.array(4),
        "text": np.array("Für Elise"),
        "nothing": np.array(""),
        "empty": np.zeros((0, 2), bool),
    }
    write_arrays(tmp_path / "some.npz", arrays)
    again = read_arrays(tmp_path / "some.npz", "arrays")
    assert list(again) == list(arrays)
    for name, array in arrays.items():
        assert again[name].dtype == array.dtype
        np.testing.assert_array_equal(again[name], array)

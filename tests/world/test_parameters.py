"""Parameters of the keyboard, against those that were checked for the paper's world."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pianomime.keyboard import BLACK, FRAME_SECONDS, KEYS
from pianomime.world.parameters import PHYSICS_DT, SUBSTEPS, key_centres, key_half_sizes, key_travel


def test_time_steps() -> None:
    assert (PHYSICS_DT, FRAME_SECONDS, SUBSTEPS) == (0.005, 0.05, 10)


def test_black_keys_are_those_of_a_piano() -> None:
    assert BLACK.sum() == 36
    names = ["A", "A#", "B", "C", "C#", "D", "D#", "E", "F", "F#", "G", "G#"]
    assert [bool(black) for black in BLACK] == ["#" in names[key % 12] for key in range(KEYS)]


def test_keys_go_up_along_y() -> None:
    assert (np.diff(key_centres()[:, 1]) > 0).all()


def test_white_keys_lie_side_by_side() -> None:
    white = key_centres()[~BLACK]
    np.testing.assert_allclose(white[:, 1], -0.6105 + 0.01125 + 0.0235 * np.arange(52), atol=1e-9)
    np.testing.assert_allclose(white[:, [0, 2]], [[0.0, 0.01125]] * 52, atol=1e-9)
    np.testing.assert_allclose(2 * key_half_sizes()[~BLACK], [[0.15, 0.0225, 0.0225]] * 52)


def test_black_keys_lie_between_white_ones() -> None:
    black = key_centres()[BLACK]
    whites_below = np.cumsum(~BLACK)[BLACK]
    # The lone first one is in the middle of its gap, the others half a millimetre off theirs.
    wanted = -0.6105 + 0.0235 * whites_below
    wanted[0] = -0.5875
    np.testing.assert_allclose(black[:, 1], wanted, atol=1e-9)
    np.testing.assert_allclose(black[:, [0, 2]], [[-0.03, 0.026]] * 36, atol=1e-9)
    np.testing.assert_allclose(2 * key_half_sizes()[BLACK], [[0.09, 0.01, 0.018]] * 36)


def test_keys_go_down_a_centimetre_or_so() -> None:
    np.testing.assert_allclose(key_travel()[~BLACK], np.arctan(0.01 / 0.15), atol=1e-6)
    np.testing.assert_allclose(key_travel()[BLACK], np.arctan(0.008 / 0.09), atol=1e-6)


@pytest.mark.parametrize("parameters", [key_centres, key_half_sizes, key_travel])
def test_nobody_can_change_them(parameters: Callable[[], NDArray[np.float64]]) -> None:
    with pytest.raises(ValueError, match="read-only"):
        parameters()[0] = 1.0


def test_every_key_is_the_papers(shared: Path) -> None:
    keys = json.loads((shared / "facts" / "world.json").read_text("utf-8"))["piano"]["keys"]
    np.testing.assert_allclose(key_centres(), [key["pos"] for key in keys], atol=1e-6)
    np.testing.assert_allclose(key_half_sizes(), [key["half_size"] for key in keys], atol=1e-9)
    np.testing.assert_allclose(key_travel(), [key["range"][1] for key in keys], atol=1e-6)
    np.testing.assert_array_equal(BLACK, [key["color"] == "black" for key in keys])

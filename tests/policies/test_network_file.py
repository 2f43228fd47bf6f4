"""ONNX files of policies: what is refused before they are run, and while they run."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pianomime.errors import InputError
from pianomime.policies.finger_residual import SIZE
from pianomime.policies.methods import FINGERS, policy_path
from pianomime.policies.network_file import load_network
from pianomime.policies.stamp import check_stamp, main, stamped


def test_a_stamp_changes_nothing_else_and_finds_every_flipped_bit(tmp_path: Path) -> None:
    whole = policy_path(FINGERS).read_bytes()
    check_stamp(whole)
    assert stamped(whole) == whole
    bare = whole[:-76]
    assert stamped(bare) == whole
    path = tmp_path / "fingers.onnx"
    path.write_bytes(bare)
    with pytest.raises(InputError, match=r"python -m pianomime\.policies\.stamp"):
        load_network(path)
    main([str(path)])
    assert path.read_bytes() == whole
    rng = np.random.default_rng(0)
    for at in [*rng.integers(len(whole), size=200), *range(len(whole) - 76, len(whole))]:
        damaged = bytearray(whole)
        damaged[at] ^= 1 << int(rng.integers(8))
        with pytest.raises(InputError):
            check_stamp(bytes(damaged))


def _says(**change: Any) -> Callable[[Any], None]:
    def edit(model: Any) -> None:
        (place,) = [each for each in model.metadata_props if each.key == "pianomime"]
        place.value = json.dumps({**json.loads(place.value), **change})

    return edit


def _not_finite(model: Any) -> None:
    import onnx

    weight = model.graph.initializer[0]
    values = np.full_like(onnx.numpy_helper.to_array(weight), np.nan)
    weight.CopyFrom(onnx.numpy_helper.from_array(values, weight.name))


DIFFUSION = {"steps": 10**9, "prediction": "sample"}


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (_says(level="none"), "level must be one of"),
        (_says(level=["finger"]), "level must be one of"),
        (_says(action_size=46), "has 5 numbers, not 46"),
        (_says(chunk=10**9), "chunk must be a whole number"),
        (_says(level="low", action_size=46), "has the inputs observation"),
        (
            _says(
                network="diffusion",
                diffusion={
                    **DIFFUSION,
                    "normalizer": dict.fromkeys(("median", "unit", "limit"), [1] * 5),
                },
            ),
            "steps must be a whole number",
        ),
        (
            _says(
                network="diffusion",
                diffusion={
                    **DIFFUSION,
                    "steps": 100,
                    "normalizer": {"median": [0] * 5, "unit": [1] * 5, "limit": [1e9] * 5},
                },
            ),
            "limit must be 0 to 50",
        ),
    ],
)
def test_whoever_stamps_it_it_must_be_a_policy(
    tmp_path: Path, edit: Callable[[Any], None], message: str
) -> None:
    onnx = pytest.importorskip("onnx")
    model = onnx.load(str(policy_path(FINGERS)))
    edit(model)
    path = tmp_path / "fingers.onnx"
    path.write_bytes(stamped(model.SerializeToString()))
    with pytest.raises(InputError, match=message) as caught:
        load_network(path)
    assert "\n" not in str(caught.value)


def test_what_it_gives_must_be_finite(tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    model = onnx.load(str(policy_path(FINGERS)))
    _not_finite(model)
    path = tmp_path / "fingers.onnx"
    path.write_bytes(stamped(model.SerializeToString()))
    run, _ = load_network(path)
    with pytest.raises(InputError, match="action is not what it should be"):
        run({"observation": np.zeros((10, SIZE), np.float32)})


@pytest.mark.parametrize("told", [True, False])
def test_an_output_that_would_be_broadcast_is_refused(tmp_path: Path, told: bool) -> None:
    """One number for all actuators of a finger, whether or not the file says so."""
    onnx = pytest.importorskip("onnx")
    helper, floats = onnx.helper, onnx.TensorProto.FLOAT
    weight = onnx.numpy_helper.from_array(np.ones((SIZE, 1), np.float32), "weight")
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["observation", "weight"], ["action"])],
        "narrow",
        [helper.make_tensor_value_info("observation", floats, ["batch", SIZE])],
        [helper.make_tensor_value_info("action", floats, ["batch", 1] if told else None)],
        [weight],
    )
    whole = onnx.load(str(policy_path(FINGERS)))
    model = helper.make_model(graph, opset_imports=whole.opset_import, ir_version=whole.ir_version)
    (text,) = [each.value for each in whole.metadata_props if each.key == "pianomime"]
    helper.set_model_props(model, {"pianomime": text})
    path = tmp_path / "fingers.onnx"
    path.write_bytes(stamped(model.SerializeToString()))
    with pytest.raises(InputError, match=r"the output action has|action is not what it should be"):
        load_network(path)[0]({"observation": np.zeros((10, SIZE), np.float32)})

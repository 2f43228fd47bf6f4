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
from pianomime.policies.interface import Shapes, inputs_of, outputs_of
from pianomime.policies.methods import FINGERS, policy_path
from pianomime.policies.network_file import load_network
from pianomime.policies.policy import METADATA, PolicyInfo
from pianomime.policies.stamp import check_stamp, main, stamped


@pytest.mark.parametrize(
    ("name", "message"),
    [
        (None, "the following arguments are required: FILE.onnx"),
        ("none.onnx", "none.onnx: No such file"),
        ("notes.txt", "notes.txt: is no ONNX file"),
        ("notes.onnx", "notes.onnx: is no ONNX file"),
    ],
)
def test_what_cannot_be_stamped_is_said_and_left_alone(
    name: str | None,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for note in ("notes.txt", "notes.onnx"):
        (tmp_path / note).write_text("to do")
    monkeypatch.setattr("sys.argv", ["stamp", *([] if name is None else [str(tmp_path / name)])])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
    assert all((tmp_path / note).read_text() == "to do" for note in ("notes.txt", "notes.onnx"))


@pytest.mark.parametrize(("probabilities", "actions"), [(4, 2), (2, 4), (0, 0), (3, 3)])
def test_bins_have_a_probability_and_an_action_each(
    probabilities: int, actions: int, tmp_path: Path
) -> None:
    onnx = pytest.importorskip("onnx")
    info = PolicyInfo("high-bet", "high", "bet", 36)
    sizes = {"probability": (1, probabilities), "actions": (1, actions, 36)}
    values = [
        onnx.numpy_helper.from_array(np.zeros((1, *shape), np.float32), name)
        for name, shape in sizes.items()
    ]

    def declared(shapes: Shapes) -> list[Any]:
        make = onnx.helper.make_tensor_value_info
        return [make(name, 1, ["B", *(each or "N" for each in shapes[name])]) for name in shapes]

    nodes = [onnx.helper.make_node("Constant", [], [value.name], value=value) for value in values]
    graph = onnx.helper.make_graph(
        nodes, "bins", declared(inputs_of(info)), declared(outputs_of(info))
    )
    opset = [onnx.helper.make_opsetid("", 17)]
    model = onnx.helper.make_model(graph, opset_imports=opset, ir_version=8)
    onnx.helper.set_model_props(model, {METADATA: info.to_metadata()})
    path = tmp_path / "bins.onnx"
    path.write_bytes(stamped(model.SerializeToString()))
    run, _ = load_network(path)
    given = {
        name: np.zeros([1, *(each or 1 for each in shape)], np.float32)
        for name, shape in inputs_of(info).items()
    }
    if probabilities == actions and actions:
        assert run(given)[1].shape == (1, 1, actions, 36)
    else:
        with pytest.raises(InputError, match="do not fit together"):
            run(given)


def test_a_stamp_changes_nothing_else_and_finds_every_flipped_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = policy_path(FINGERS).read_bytes()
    check_stamp(whole)
    assert stamped(whole) == whole
    bare = whole[:-76]
    assert stamped(bare) == whole
    path = tmp_path / "fingers.onnx"
    path.write_bytes(bare)
    with pytest.raises(InputError, match=r"python -m pianomime\.policies\.stamp"):
        load_network(path)
    monkeypatch.setattr("sys.argv", ["stamp", str(path)])
    main()
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

"""PolicyInfo: what a policy file tells of itself, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pianomime.errors import InputError
from pianomime.policies.features import Observation
from pianomime.policies.policy import AsinhNormalizer, DiffusionInfo, NetworkPolicy, PolicyInfo
from pianomime.policies.sampler import Sampler

NORMALIZER = AsinhNormalizer((0.0, 0.1), (1.0, 0.5), (2.0, 3.0))
DIFFUSION = PolicyInfo(
    "high-diff", "high", "diffusion", 2, 4, diffusion=DiffusionInfo(100, "sample", NORMALIZER)
)
PLAIN = PolicyInfo("low-mse", "low", "mlp", 46, data="0123", licence="Apache-2.0")


@pytest.mark.parametrize("info", [DIFFUSION, PLAIN, replace(PLAIN, residual=True)])
def test_what_is_written_is_read(info: PolicyInfo) -> None:
    assert PolicyInfo.from_metadata(info.to_metadata()) == info


def without(name: str) -> Any:
    def change(content: dict[str, Any]) -> None:
        del content[name]

    return change


def changed(**fields: Any) -> Any:
    return lambda content: content.update(fields)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed(format="pianomime stage"), "not a pianomime policy"),
        (changed(version=1), "version 1; this program reads 2"),
        (without("version"), "version None"),
        (without("level"), "missing or unknown: level"),
        (changed(colour="red"), "missing or unknown: colour"),
        (changed(level="whole"), "level must be one of"),
        (changed(network="cnn"), "network must be one of"),
        (changed(network=["mlp"]), "network must be one of"),
        (changed(name=7), "name must be text"),
        (changed(chunk=0), "chunk must be a whole number"),
        (changed(chunk=True), "chunk must be a whole number"),
        (changed(action_size=46.0), "action_size must be a whole number"),
        (changed(residual="no"), "residual must be"),
        (changed(residual=True), "no base controller"),
        (changed(diffusion=None), "tells of its diffusion"),
        (changed(network="mlp"), "tells of its diffusion"),
        (changed(action_size=3), "normalizer of 2 numbers"),
        (changed(diffusion=[1]), "diffusion must be an object"),
        (lambda content: content["diffusion"].update(steps=1), "diffusion.steps must be"),
        (lambda content: content["diffusion"].update(prediction="v"), "prediction must be"),
        (
            lambda content: content["diffusion"].update(normalizer=None),
            "normalizer must be an object",
        ),
        (
            lambda content: content["diffusion"]["normalizer"].update(unit=[1.0]),
            "normalizer.unit must be 2",
        ),
        (
            lambda content: content["diffusion"]["normalizer"].update(median=["a", "b"]),
            "normalizer.median must be numbers",
        ),
        (
            lambda content: content["diffusion"]["normalizer"].update(limit=[1.0, float("nan")]),
            "normalizer.limit must be 2 finite",
        ),
    ],
)
def test_bad_metadata_are_refused_in_one_line(change: Any, message: str) -> None:
    content = json.loads(DIFFUSION.to_metadata())
    change(content)
    with pytest.raises(InputError, match=message) as error:
        PolicyInfo.from_metadata(json.dumps(content))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "[]", "7", '"high-diff"'])
def test_what_is_no_metadata_is_refused(text: str) -> None:
    with pytest.raises(InputError):
        PolicyInfo.from_metadata(text)


def test_denormalized_actions_are_a_hyperbolic_sine_of_normalized_ones() -> None:
    actions = NORMALIZER.denormalize(np.array([[0.0, 0.0], [1.0, -1.0]], np.float32))
    np.testing.assert_allclose(actions, [[0.0, 0.1], [np.sinh(2), 0.1 - 0.5 * np.sinh(3)]], 1e-6)
    assert actions.dtype == np.float32


def test_a_transformer_samples_bins_as_often_as_they_are_probable() -> None:
    rows = 4000
    info = PolicyInfo("high-bet", "high", "bet", 36, 1)

    def run(inputs: dict[str, Any]) -> list[np.ndarray]:
        probability = np.tile(np.float32([0.2, 0.5, 0.3]), (rows, 1, 1))
        actions = np.broadcast_to(np.arange(3.0)[:, None], (rows, 1, 3, 36)).astype(np.float32)
        return [probability, actions]

    observation: Observation = {
        "goal": np.zeros((rows, 10, 88), np.float32),
        "frames": np.zeros((rows, 10, 0), np.float32),
        "vector": np.zeros((rows, 36), np.float32),
    }
    policy = NetworkPolicy(run, info, Sampler())
    chosen = policy.act(observation, np.random.default_rng(0))[:, 0, 0]
    assert np.bincount(chosen.astype(int)) / rows == pytest.approx([0.2, 0.5, 0.3], abs=0.03)

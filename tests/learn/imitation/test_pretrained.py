"""Fine-tuning: the weights of a policy's file come back as they were, and are trained further."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch

from pianomime import cli
from pianomime.errors import InputError
from pianomime.learn.data.episode import COLUMNS, Episode
from pianomime.learn.data.trajectories import write_trajectories
from pianomime.learn.goal.autoencoder import GoalEncoder
from pianomime.learn.imitation.config import DiffusionConfig, MlpConfig, policy_config
from pianomime.learn.imitation.export import export_policy, policy_info, torch_policy
from pianomime.learn.imitation.network import PolicyNetwork
from pianomime.learn.imitation.pretrained import check_pretrained, load_pretrained
from pianomime.learn.imitation.samples import Samples
from pianomime.learn.imitation.training import train_policy
from pianomime.learn.runs.trainer_config import TrainerConfig
from pianomime.policies.methods import policy_path
from pianomime.policies.network_file import load_policy
from pianomime.policies.sampler import Sampler
from pianomime.policies.stamp import stamped

SMALL = {
    "diffusion": DiffusionConfig(channels=(8, 16, 16), condition_layers=(24,), step_embedding=8),
    "mlp": MlpConfig((32, 24)),
}


def config_of(name):
    config = policy_config(name)
    return replace(config, **{config.network: SMALL[config.network]})


def a_network(clips, name, seed):
    """A network with random weights, group normalizations included, and samples for it."""
    config = config_of(name)
    sample = Samples.of(clips, config).evenly(57)
    torch.manual_seed(seed)
    encoder = GoalEncoder() if config.goal_encoding == "sdf" else None
    shapes = {key: value.shape[1:] for key, value in sample.items()}
    network = PolicyNetwork(config, shapes, encoder)
    network.fit_normalizers(sample)
    with torch.no_grad():
        for weight in network.parameters():
            weight.add_(0.1 * torch.randn_like(weight))
    return network, sample


def assert_same_outputs(network, path, sample):
    policy = load_policy(path)
    inputs = {key: sample[key] for key in ("goal", "frames", "vector") if sample[key].size}
    if policy.info.diffusion is not None:
        noise = np.random.default_rng(0).standard_normal(sample["target"].shape)
        inputs["noisy"] = noise.astype(np.float32)
        inputs["step"] = np.arange(len(noise)) % 100
    expected, outputs = policy.run(inputs), torch_policy(network).run(inputs)
    for one, other in zip(outputs, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-3, atol=5e-3)


@pytest.mark.parametrize("name", ["high-diff", "low-diff-no-sdf", "low-mse"])
def test_the_weights_of_a_file_come_back(clips, tmp_path, name):
    network, sample = a_network(clips, name, 0)
    path = tmp_path / f"{name}.onnx"
    export_policy(network, policy_info(network, name), path)
    other, _ = a_network(clips, name, 1)
    load_pretrained(other, path)
    assert_same_outputs(other, path, sample)
    wanted, state = network.state_dict(), other.state_dict()
    for key, value in state.items():
        # Large weights are in the file in 16 bits.
        torch.testing.assert_close(value, wanted[key], rtol=1e-3, atol=1e-6, msg=key)


@pytest.mark.parametrize("name", ["high-diff", "low-diff"])
def test_bundled_policies_can_be_trained_further(clips, name):
    config = policy_config(name)
    path = policy_path(name)
    assert check_pretrained(config, path).licence == "research-only"
    sample = Samples.of(clips, config).evenly(16)
    shapes = {key: value.shape[1:] for key, value in sample.items()}
    network = PolicyNetwork(config, shapes, GoalEncoder())
    load_pretrained(network, path)
    assert_same_outputs(network, path, sample)


@pytest.fixture
def data_set(clips, tmp_path):
    """The clips as episodes of three songs."""
    frames = int(clips.ends[-1])
    columns = {
        name: clips.columns.get(name, np.zeros((frames, *column.shape), column.dtype))
        for name, column in COLUMNS.items()
    }
    parts = zip(clips.name, clips.starts, clips.ends, strict=True)
    episodes = (
        Episode(name, 0.0, "ik", {key: each[start:end] for key, each in columns.items()}, number)
        for number, (name, start, end) in enumerate(parts)
    )
    write_trajectories(tmp_path / "data.zarr", episodes)
    return tmp_path / "data.zarr"


def test_no_step_at_all_changes_nothing_and_steps_do(data_set, clips, tmp_path):
    """A learning rate of nearly nothing leaves the policy what it was; another does not."""
    name = "low-diff"
    network, sample = a_network(clips, name, 0)
    path = tmp_path / f"{name}.onnx"
    info = replace(policy_info(network, name), licence="only for me")
    export_policy(network, info, path)
    observation = {key: sample[key] for key in ("goal", "frames", "vector")}

    def acted(file):
        policy = load_policy(file, Sampler(steps=2))
        return policy.info, policy.act(observation, np.random.default_rng(0))

    far = []
    for rate in (1e-9, 1e-2):
        trainer = TrainerConfig(steps=3, batch=8, warmup=1, learning_rate=rate)
        config = replace(config_of(name), trainer=trainer)
        out = tmp_path / f"{rate}"
        tuned = train_policy(name, config, out, None, [data_set], None, pretrained=path)
        tuned_info, actions = acted(tuned)
        assert tuned_info.licence == "only for me"
        far.append(np.abs(actions - acted(path)[1]).max())
    assert 10 * far[0] < far[1]


def test_another_pretrained_policy_is_another_training(data_set, clips, tmp_path):
    config = replace(config_of("low-diff"), trainer=TrainerConfig(steps=2, batch=4, warmup=1))
    files = []
    for seed in range(2):
        network, _ = a_network(clips, "low-diff", seed)
        files.append(tmp_path / f"{seed}.onnx")
        export_policy(network, policy_info(network, "low-diff"), files[-1])
    out = tmp_path / "out"
    first = train_policy("low-diff", config, out, None, [data_set], None, pretrained=files[0])
    content = first.read_bytes()
    again = train_policy("low-diff", config, out, None, [data_set], None, pretrained=files[0])
    assert again.read_bytes() == content
    with pytest.raises(InputError, match="pretrained"):
        train_policy("low-diff", config, out, None, [data_set], None, pretrained=files[1])


def test_what_cannot_be_trained_further_is_refused(clips, tmp_path, capsys):
    network, _ = a_network(clips, "low-diff", 0)
    path = tmp_path / "low-diff.onnx"
    export_policy(network, policy_info(network, "low-diff"), path)
    for name, message in (
        ("high-diff", "level is low, not high"),
        ("low-mse", "network is diffusion, not mlp"),
        ("low-diff-res", "residual is False, not True"),
    ):
        with pytest.raises(InputError, match=message):
            check_pretrained(config_of(name), path)
    epsilon = replace(SMALL["diffusion"], prediction="epsilon")
    with pytest.raises(InputError, match=r"diffusion\.prediction is sample, not epsilon"):
        check_pretrained(replace(config_of("low-diff"), diffusion=epsilon), path)
    with pytest.raises(InputError, match="does not exist"):
        check_pretrained(config_of("low-diff"), tmp_path / "none.onnx")
    binary, _ = a_network(clips, "low-diff-no-sdf", 0)
    export_policy(binary, policy_info(binary, "low-diff-no-sdf"), tmp_path / "binary.onnx")
    with pytest.raises(InputError, match="transformers cannot be fine-tuned"):
        check_pretrained(policy_config("low-bet"), path)
    with pytest.raises(InputError, match=r"another size of network, or kind of goals \(encoder"):
        load_pretrained(network, tmp_path / "binary.onnx")
    larger = replace(
        config_of("low-diff"), diffusion=replace(SMALL["diffusion"], channels=(8, 16, 32))
    )
    shapes = {"goal": (4, 88), "frames": (4, 72), "vector": (232,), "target": (4, 46)}
    with pytest.raises(InputError, match="another size of network"):
        load_pretrained(PolicyNetwork(larger, shapes, GoalEncoder()), path)
    lost = onnx.load(str(path))
    for node in lost.graph.node:
        node.name = ""
    (tmp_path / "nameless.onnx").write_bytes(stamped(lost.SerializeToString()))
    with pytest.raises(InputError, match="another size of network"):
        load_pretrained(network, tmp_path / "nameless.onnx")
    with pytest.raises(SystemExit) as ended:
        cli.main(["train", "low-diff", "--experts", "x", "--pretrained", str(path), "--goal", "y"])
    assert ended.value.code == 2
    assert "--goal and --pretrained: name one of the two" in capsys.readouterr().err
    with pytest.raises(InputError, match="would be replaced"):
        train_policy(
            "low-diff", config_of("low-diff"), tmp_path, None, [path], None, pretrained=path
        )


@pytest.mark.parametrize(
    ("name", "less"),
    [
        ("low-mse", MlpConfig((32,))),
        ("low-diff", replace(SMALL["diffusion"], condition_layers=())),
        ("low-diff", replace(SMALL["diffusion"], skip=False)),
    ],
)
def test_a_file_of_more_layers_is_refused(clips, tmp_path, name, less):
    network, sample = a_network(clips, name, 0)
    path = tmp_path / f"{name}.onnx"
    export_policy(network, policy_info(network, name), path)
    config = config_of(name)
    shapes = {key: value.shape[1:] for key, value in sample.items()}
    smaller = PolicyNetwork(replace(config, **{config.network: less}), shapes, network.encoder)
    with pytest.raises(InputError, match="another size of network"):
        load_pretrained(smaller, path)

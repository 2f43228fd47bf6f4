from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from pianomime import load_player
from pianomime.errors import InputError
from pianomime.learn.goal.autoencoder import GoalEncoder
from pianomime.learn.imitation.config import POLICIES, DiffusionConfig, policy_config
from pianomime.learn.imitation.export import export_policy, policy_info, torch_policy
from pianomime.learn.imitation.network import PolicyNetwork
from pianomime.learn.imitation.normalizer import AsinhNormalizer
from pianomime.learn.imitation.samples import Samples
from pianomime.learn.imitation.unet import FrameConvolution, TemporalEncoder
from pianomime.policies.features import action_reference
from pianomime.policies.methods import WEIGHTS
from pianomime.policies.network_file import load_policy
from pianomime.policies.sampler import Sampler

INPUTS = ("goal", "frames", "vector")
TINY = DiffusionConfig(channels=(16, 32, 32), condition_layers=(32,), step_embedding=16)


def a_network(clips, name, size="small", encoder=None, tiny=False):
    encoding = "binary" if encoder is None else "sdf"
    config = replace(policy_config(name, size), goal_encoding=encoding, tip_noise=0.0)
    if tiny and config.network == "diffusion":
        config = replace(config, diffusion=TINY)
    sample = Samples.of(clips, config).evenly(57)
    torch.manual_seed(0)
    shapes = {key: value.shape[1:] for key, value in sample.items()}
    return PolicyNetwork(config, shapes, encoder), sample


def export(network, name, path):
    export_policy(network, policy_info(network, name), path)


def by_hand(network):
    """Parameters of a U-Net and its encoder, counted from tables 7 and the sizes seen."""
    config, (channels, vector) = network.config.diffusion, input_sizes(network)
    width, embedding = network.action_size, config.step_embedding
    frames = 10 if network.config.level == "high" else 4
    count, before = 0, channels
    for after in config.encoder_channels:
        count += before * after * config.encoder_kernel_size + 3 * after
        before = after
    film = frames * before + vector + embedding
    count += 8 * embedding * embedding + 5 * embedding

    def block(before, after):
        convolutions = (before + after) * after * config.kernel_size + 2 * 3 * after
        shortcut = before * after + after if before != after else 0
        return convolutions + film * 2 * after + 2 * after + shortcut

    first, second, third = config.channels
    for before, after in ((width, first), (first, second), (second, third)):
        count += block(before, after) + block(after, after)
    count += sum(after * after * 3 + after for after in (first, second))
    count += 2 * block(third, third)
    for before, after in ((third, second), (second, first)):
        count += block(2 * before, after) + block(after, after) + after * after * 4 + after
    return count + first * first * config.kernel_size + 3 * first + first * width + width


def input_sizes(network):
    return 88 + network.frame_features, network.vector_features


@pytest.mark.parametrize("name", ["high-diff", "low-diff", "low-diff-res", "one-stage-diff"])
def test_the_papers_size_has_as_many_parameters_as_table_7_makes(clips, name):
    with torch.device("meta"):  # shapes alone
        network, _ = a_network(clips, name, "paper")
    assert network.parameter_count == pytest.approx(by_hand(network), rel=0.05)


@pytest.mark.parametrize(
    ("name", "millions"), [("high-diff", 74.97), ("low-diff", 72.30), ("low-diff-res", 72.96)]
)
def test_with_codes_of_goals_it_has_as_many_as_the_results_say(clips, name, millions):
    with torch.device("meta"):
        network, _ = a_network(clips, name, "paper", GoalEncoder())
    assert network.parameter_count / 1e6 == pytest.approx(millions, abs=0.01)


@pytest.mark.parametrize("name", ["high-bet", "low-bet"])
def test_so_has_a_transformer_as_table_8_makes(clips, name):
    with torch.device("meta"):
        network, _ = a_network(clips, name, "paper")
    (channels, vector), out = input_sizes(network), network.action_size
    wide, bins = 120, 64
    frames = (10 if name == "high-bet" else 4) + 1 + 4
    layer = 4 * wide * wide + 4 * wide + 8 * wide * wide + 5 * wide + 4 * wide
    count = (channels + vector + 2) * wide + frames * wide + 8 * layer + 2 * wide
    count += (wide + 1) * bins * (1 + out)
    assert network.parameter_count == count


def test_so_has_the_plain_network_of_appendix_g(clips):
    with torch.device("meta"):
        network, _ = a_network(clips, "bc-mse", "paper")
    given = 4 * 88 + input_sizes(network)[1]
    count = (given + 1) * 1024 + 2 * 1025 * 1024 + 3 * 2 * 1024 + 1025 * 46
    assert network.parameter_count == count


@pytest.mark.parametrize("name", POLICIES)
@pytest.mark.parametrize("size", ["small", "paper"])
def test_the_configs_that_there_are_can_be_trained(name, size):
    assert policy_config(name, size).trainer.steps > 0


@pytest.mark.parametrize(
    ("name", "part", "change"),
    [
        ("high-diff", None, {"tip_noise": -1.0}),
        ("low-diff", None, {"target_noise": float("nan")}),
        ("low-diff", "diffusion", {"channels": (20, 40)}),
        ("low-diff", "diffusion", {"channels": (8, 8, 8, 8)}),
        ("low-diff", "diffusion", {"channels": ()}),
        ("low-diff", "diffusion", {"encoder_channels": ()}),
        ("low-diff", "diffusion", {"kernel_size": 4}),
        ("low-diff", "diffusion", {"step_embedding": 7}),
        ("low-diff", "diffusion", {"condition_layers": (0,)}),
        ("low-diff", "diffusion", {"steps": 1}),
        ("low-bet", "bet", {"heads": 7}),
        ("low-bet", "bet", {"bins": 1}),
        ("bc-mse", "mlp", {"hidden": (64, 0)}),
        ("bc-mse", "trainer", {"steps": 0}),
        # What would do nothing.
        ("high-diff", None, {"target_noise": 0.1}),
        ("low-diff", None, {"hand_noise": 0.1}),
        ("high-diff", "bet", {"layers": 2}),
    ],
)
def test_settings_that_do_not_fit_are_refused(name, part, change):
    config = policy_config(name)
    with pytest.raises(InputError, match=r"must|levels|does nothing"):
        replace(
            config, **change if part is None else {part: replace(getattr(config, part), **change)}
        )


@pytest.mark.parametrize("name", POLICIES)
def test_actions_have_the_shape_of_the_target(clips, name):
    network, sample = a_network(clips, name)
    network.fit_normalizers(sample)
    policy = torch_policy(network, sampler=Sampler(2))
    action = policy.act({key: sample[key] for key in INPUTS}, np.random.default_rng(0))
    assert action.shape == sample["target"].shape
    assert np.isfinite(action).all()


@pytest.mark.parametrize("coded", [False, True])
@pytest.mark.parametrize("name", POLICIES)
def test_onnx_acts_as_torch_does(clips, name, coded, tmp_path):
    network, sample = a_network(clips, name, encoder=GoalEncoder() if coded else None, tiny=True)
    network.fit_normalizers(sample)
    export(network, name, tmp_path / "policy.onnx")
    # As precise as what is in the file.
    for weight in network.state_dict().values():
        if weight.numel() >= 1024:
            weight.copy_(weight.half().float())
    given = {key: sample[key] for key in INPUTS}
    ours, theirs = (
        policy.act(given, np.random.default_rng(3))
        for policy in (
            load_policy(tmp_path / "policy.onnx", Sampler(3)),
            torch_policy(network, sampler=Sampler(3)),
        )
    )
    np.testing.assert_allclose(ours, theirs, atol=2e-4)


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        ("high-diff", 250),
        ("high-bet", 150),
        ("low-diff", 250),
        ("low-diff-res", 250),
        ("low-bet", 150),
        ("one-stage-diff", 250),
        ("bc-mse", 150),
    ],
)
def test_it_learns_a_clip_by_heart(clips, name, steps):
    network, sample = a_network(clips, name, tiny=True)
    network.fit_normalizers(sample)
    # A few frames, each with much noise of many kinds.
    sample = {key: np.repeat(value[::10], 10, axis=0) for key, value in sample.items()}
    batch = {key: torch.from_numpy(value) for key, value in sample.items()}
    optimizer = torch.optim.AdamW(network.net.parameters(), 3e-3)
    network.train()
    for _ in range(steps):
        loss = network(batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    action = torch_policy(network).act(
        {key: sample[key] for key in INPUTS}, np.random.default_rng(0)
    )
    level, residual = network.config.level, network.config.residual
    off = action - sample["target"] - action_reference(level, residual, sample["vector"])
    assert np.abs(off).mean() < 0.3 * np.abs(sample["target"]).mean()


def test_what_is_beyond_the_frames_ahead_does_not_matter_to_the_encoder_of_another_sample():
    encoder = TemporalEncoder(4, 5, TINY)
    frames = torch.randn(6, 4, 5)
    together = encoder(frames)
    torch.testing.assert_close(together[2:3], encoder(frames[2:3]))


@pytest.mark.parametrize("frames", [1, 2, 4, 10])
@pytest.mark.parametrize(("kernel", "stride"), [(1, 1), (3, 1), (5, 1), (3, 2)])
def test_as_a_matrix_product_a_convolution_is_the_same(frames, kernel, stride):
    ours = FrameConvolution(3, 6, kernel, frames, stride)
    theirs = torch.nn.Conv1d(3, 6, kernel, stride, kernel // 2)
    theirs.weight, theirs.bias = ours.weight, ours.bias
    x = torch.randn(5, 3, frames)
    torch.testing.assert_close(ours(x), theirs(x))


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_so_does_one_that_doubles_the_frames(frames):
    ours = FrameConvolution(3, 6, 4, frames, stride=2, transposed=True)
    theirs = torch.nn.ConvTranspose1d(3, 6, 4, 2, 1)
    theirs.weight, theirs.bias = ours.weight, ours.bias
    x = torch.randn(5, 3, frames)
    torch.testing.assert_close(ours(x), theirs(x))


def test_normalized_actions_are_denormalized():
    normalizer = AsinhNormalizer(3)
    values = np.random.default_rng(0).standard_t(2, (5000, 3)) * [1e-3, 0.1, 2.0]
    normalizer.fit(values)
    inside = torch.from_numpy(values[:200]).float()
    normalized = normalizer(inside)
    assert normalized.abs().max() <= 1
    kept = normalized.abs() < 1
    torch.testing.assert_close(
        normalizer.denormalize(normalized)[kept], inside[kept], rtol=1e-3, atol=1e-6
    )


def test_what_hardly_ever_changes_does_no_harm(clips):
    """A key that is down in one sample of thousands."""
    network, sample = a_network(clips, "low-diff")
    many = {key: np.repeat(value, 100, axis=0) for key, value in sample.items()}
    many["vector"][:, -1] = 0.0
    many["vector"][0, -1] = 1.0
    network.fit_normalizers(many)
    _, vector = network.encode(*(torch.from_numpy(many[key]) for key in INPUTS))
    assert vector.abs().max() <= 8.0


def test_columns_that_never_change_do_no_harm(clips):
    network, sample = a_network(clips, "low-diff")
    sample["vector"][:, -1] = 0.25
    network.fit_normalizers(sample)
    sample["vector"][:, -1] = 0.26
    _, vector = network.encode(*(torch.from_numpy(sample[key]) for key in INPUTS))
    assert vector[:, -1].abs().max() < 1


@pytest.mark.parametrize("content", [b"", b"not a network", None])
def test_a_file_that_is_no_policy_is_refused(clips, tmp_path, content):
    path = tmp_path / "policy.onnx"
    if content is None:
        network, _ = a_network(clips, "bc-mse")
        export(network, "bc-mse", path)
        content = path.read_bytes()[: path.stat().st_size // 2]
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        load_policy(path)


def test_another_policy_under_its_name_is_refused(clips, tmp_path, monkeypatch):
    monkeypatch.setenv(WEIGHTS, str(tmp_path))
    network, _ = a_network(clips, "low-diff", tiny=True)
    for name in ("high-diff", "low-diff", "bc-mse", "fingers"):
        export(network, "low-diff", tmp_path / f"{name}.onnx")
    for player in ("two-stage-diff", "bc-mse", "fingers"):
        with pytest.raises(InputError, match="holds the policy low-diff"):
            load_player(player)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        load_policy(tmp_path / "policy.onnx")

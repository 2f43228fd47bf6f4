from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from pianomime import Player
from pianomime.errors import InputError
from pianomime.learn.data.samples import Windows
from pianomime.learn.goal.autoencoder import GoalEncoder
from pianomime.learn.imitation.config import POLICIES, DiffusionConfig, check_stage, policy_config
from pianomime.learn.imitation.export import export_stage, torch_policy
from pianomime.learn.imitation.network import SaidScale, Stage
from pianomime.learn.imitation.unet import FrameConvolution, TemporalEncoder
from pianomime.policies.features import base
from pianomime.policies.methods import WEIGHTS
from pianomime.policies.policy import load_policy
from pianomime.policies.sampler import Sampler

SEEN = ("goal", "frames", "vector")
TINY = DiffusionConfig(channels=(16, 32, 32), condition=(32,), step_width=16)


def a_stage(clips, name, size="small", encoder=None, **changes):
    code = "binary" if encoder is None else "sdf"
    config = replace(policy_config(name, size), code=code, tip_noise=0.0, **changes)
    sample = Windows.of(clips, config).some(57)
    torch.manual_seed(0)
    stage = Stage(config, {key: value.shape[1:] for key, value in sample.items()}, encoder)
    return stage, sample


def by_hand(stage):
    """Parameters of a U-Net and its encoder, counted from tables 7 and the sizes seen."""
    config, (channels, vector) = stage.config.diffusion, seen_widths(stage)
    width, told = len(stage.target.middle), config.step_width
    frames = 10 if stage.config.level == "high" else 4
    count, before = 0, channels
    for after in config.encoder:
        count += before * after * config.encoder_kernel + 3 * after
        before = after
    film = frames * before + vector + told
    count += told * 4 * told + 4 * told + 4 * told * told + told

    def block(before, after):
        convolutions = (before + after) * after * config.kernel + 2 * 3 * after
        past = before * after + after if before != after else 0
        return convolutions + film * 2 * after + 2 * after + past

    first, second, third = config.channels
    for before, after in ((width, first), (first, second), (second, third)):
        count += block(before, after) + block(after, after)
    count += sum(after * after * 3 + after for after in (first, second))
    count += 2 * block(third, third)
    for before, after in ((third, second), (second, first)):
        count += block(2 * before, after) + block(after, after) + after * after * 4 + after
    return count + first * first * config.kernel + 3 * first + first * width + width


def seen_widths(stage):
    return 88 + len(stage.frames.middle), len(stage.vector.middle)


@pytest.mark.parametrize("name", ["high-diff", "low-diff", "low-diff-res", "one-stage-diff"])
def test_the_papers_size_has_as_many_parameters_as_table_7_makes(clips, name):
    with torch.device("meta"):  # shapes alone
        stage, _ = a_stage(clips, name, "paper")
    assert stage.parameters_learned == pytest.approx(by_hand(stage), rel=0.05)


@pytest.mark.parametrize(
    ("name", "millions"), [("high-diff", 74.97), ("low-diff", 72.30), ("low-diff-res", 72.96)]
)
def test_with_codes_of_goals_it_has_as_many_as_the_results_say(clips, name, millions):
    with torch.device("meta"):
        stage, _ = a_stage(clips, name, "paper", GoalEncoder())
    assert stage.parameters_learned / 1e6 == pytest.approx(millions, abs=0.01)


@pytest.mark.parametrize("name", ["high-bet", "low-bet"])
def test_so_has_a_transformer_as_table_8_makes(clips, name):
    with torch.device("meta"):
        stage, _ = a_stage(clips, name, "paper")
    (channels, vector), out = seen_widths(stage), len(stage.target.middle)
    wide, bins = 120, 64
    frames = (10 if name == "high-bet" else 4) + 1 + 4
    layer = 4 * wide * wide + 4 * wide + 8 * wide * wide + 5 * wide + 4 * wide
    count = (channels + vector + 2) * wide + frames * wide + 8 * layer + 2 * wide
    count += (wide + 1) * bins * (1 + out)
    assert stage.parameters_learned == count


def test_so_has_the_plain_network_of_appendix_g(clips):
    with torch.device("meta"):
        stage, _ = a_stage(clips, "bc-mse", "paper")
    given = 4 * 88 + seen_widths(stage)[1]
    count = (given + 1) * 1024 + 2 * 1025 * 1024 + 3 * 2 * 1024 + 1025 * 46
    assert stage.parameters_learned == count


@pytest.mark.parametrize("name", POLICIES)
@pytest.mark.parametrize("size", ["small", "paper"])
def test_the_configs_that_there_are_can_be_trained(name, size):
    check_stage(policy_config(name, size))


@pytest.mark.parametrize(
    ("name", "part", "change"),
    [
        ("high-diff", None, {"tip_noise": -1.0}),
        ("low-diff", None, {"target_noise": float("nan")}),
        ("low-diff", "diffusion", {"channels": (20, 40)}),
        ("low-diff", "diffusion", {"channels": (8, 8, 8, 8)}),
        ("low-diff", "diffusion", {"channels": ()}),
        ("low-diff", "diffusion", {"encoder": ()}),
        ("low-diff", "diffusion", {"kernel": 4}),
        ("low-diff", "diffusion", {"step_width": 7}),
        ("low-diff", "diffusion", {"condition": (0,)}),
        ("low-diff", "diffusion", {"steps": 1}),
        ("low-bet", "bet", {"heads": 7}),
        ("low-bet", "bet", {"bins": 1}),
        ("bc-mse", "mlp", {"hidden": (64, 0)}),
        ("bc-mse", "fit", {"steps": 0}),
        # What would do nothing.
        ("high-diff", None, {"target_noise": 0.1}),
        ("low-diff", None, {"hand_noise": 0.1}),
        ("high-diff", "bet", {"layers": 2}),
    ],
)
def test_settings_that_do_not_fit_are_refused(name, part, change):
    config = policy_config(name)
    changed = change if part is None else {part: replace(getattr(config, part), **change)}
    with pytest.raises(InputError, match=r"must|levels|does nothing"):
        check_stage(replace(config, **changed))


@pytest.mark.parametrize("name", POLICIES)
def test_what_is_said_has_the_shape_of_what_should_be(clips, name):
    stage, sample = a_stage(clips, name)
    stage.fit_scales(sample)
    policy = torch_policy(stage, sampler=Sampler(2))
    told = policy.say({key: sample[key] for key in SEEN}, np.random.default_rng(0))
    assert told.shape == sample["target"].shape
    assert np.isfinite(told).all()


@pytest.mark.parametrize("coded", [False, True])
@pytest.mark.parametrize("name", POLICIES)
def test_onnx_says_what_torch_says(clips, name, coded, tmp_path):
    stage, sample = a_stage(clips, name, encoder=GoalEncoder() if coded else None, diffusion=TINY)
    stage.fit_scales(sample)
    export_stage(stage, name, tmp_path / "stage.onnx")
    # As precise as what is in the file.
    for weight in stage.state_dict().values():
        if weight.numel() >= 1024:
            weight.copy_(weight.half().float())
    given = {key: sample[key] for key in SEEN}
    ours, theirs = (
        policy.say(given, np.random.default_rng(3))
        for policy in (
            load_policy(tmp_path / "stage.onnx", Sampler(3)),
            torch_policy(stage, sampler=Sampler(3)),
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
    stage, sample = a_stage(clips, name, diffusion=TINY)
    stage.fit_scales(sample)
    # A few frames, each with much noise of many kinds.
    sample = {key: np.repeat(value[::10], 10, axis=0) for key, value in sample.items()}
    batch = {key: torch.from_numpy(value) for key, value in sample.items()}
    optimizer = torch.optim.AdamW(stage.net.parameters(), 3e-3)
    stage.train()
    for _ in range(steps):
        loss = stage(batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    told = torch_policy(stage).say({key: sample[key] for key in SEEN}, np.random.default_rng(0))
    level, prior = stage.config.level, stage.config.prior
    off = told - sample["target"] - base(level, prior, sample["vector"])
    assert np.abs(off).mean() < 0.3 * np.abs(sample["target"]).mean()


def test_what_is_beyond_the_frames_ahead_does_not_matter_to_the_encoder_of_another_sample():
    encoder = TemporalEncoder(4, 5, TINY)
    frames = torch.randn(6, 4, 5)
    together = encoder(frames)
    torch.testing.assert_close(together[2:3], encoder(frames[2:3]))


@pytest.mark.parametrize("frames", [1, 2, 4, 10])
@pytest.mark.parametrize(("kernel", "stride"), [(1, 1), (3, 1), (5, 1), (3, 2)])
def test_as_a_product_of_matrices_a_convolution_says_the_same(frames, kernel, stride):
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


def test_scales_are_taken_back():
    scale = SaidScale(3)
    values = np.random.default_rng(0).standard_t(2, (5000, 3)) * [1e-3, 0.1, 2.0]
    scale.fit(values)
    inside = torch.from_numpy(values[:200]).float()
    scaled = scale(inside)
    assert scaled.abs().max() <= 1
    kept = scaled.abs() < 1
    torch.testing.assert_close(scale.undo(scaled)[kept], inside[kept], rtol=1e-3, atol=1e-6)


def test_what_hardly_ever_changes_does_no_harm(clips):
    """A key that is down in one sample of thousands."""
    stage, sample = a_stage(clips, "low-diff")
    many = {key: np.repeat(value, 100, axis=0) for key, value in sample.items()}
    many["vector"][:, -1] = 0.0
    many["vector"][0, -1] = 1.0
    stage.fit_scales(many)
    _, vector = stage.seen(*(torch.from_numpy(many[key]) for key in SEEN))
    assert vector.abs().max() <= 8.0


def test_columns_that_never_change_do_no_harm(clips):
    stage, sample = a_stage(clips, "low-diff")
    sample["vector"][:, -1] = 0.25
    stage.fit_scales(sample)
    sample["vector"][:, -1] = 0.26
    _, vector = stage.seen(*(torch.from_numpy(sample[key]) for key in SEEN))
    assert vector[:, -1].abs().max() < 1


@pytest.mark.parametrize("content", [b"", b"not a network", None])
def test_a_file_that_is_no_stage_is_refused(clips, tmp_path, content):
    path = tmp_path / "stage.onnx"
    if content is None:
        stage, _ = a_stage(clips, "bc-mse")
        export_stage(stage, "bc-mse", path)
        content = path.read_bytes()[: path.stat().st_size // 2]
    path.write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        load_policy(path)


def test_another_stage_under_its_name_is_refused(clips, tmp_path, monkeypatch):
    monkeypatch.setenv(WEIGHTS, str(tmp_path))
    stage, _ = a_stage(clips, "low-diff", diffusion=TINY)
    for name in ("high-diff", "low-diff", "bc-mse", "fingers"):
        export_stage(stage, "low-diff", tmp_path / f"{name}.onnx")
    for player in ("two-stage-diff", "bc-mse", "fingers"):
        with pytest.raises(InputError, match="holds the stage low-diff"):
            Player.from_name(player)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        load_policy(tmp_path / "stage.onnx")

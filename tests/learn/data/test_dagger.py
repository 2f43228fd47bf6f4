from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pianomime import cli
from pianomime.errors import InputError, WorkFailed
from pianomime.learn.data import dagger
from pianomime.learn.data.dagger import (
    collect_dagger,
    collect_dagger_episodes,
    songs_without_plan,
)
from pianomime.learn.data.dagger_config import DaggerConfig
from pianomime.learn.data.episode import Episode, record
from pianomime.learn.data.noisy_controller import NoisyController, noise_spread
from pianomime.learn.data.trajectories import TrajectoryData
from pianomime.music import Score
from pianomime.plan import ZeroShotPlanner
from pianomime.plan.demonstration import Demonstration
from pianomime.plan.fingertip_plan import HOVER_HEIGHT
from pianomime.plan.hand_path import make_feasible
from pianomime.policies.methods import weights_folder
from pianomime.track import DynamicTracker
from pianomime.world import World
from pianomime.world.batch_base import OneOfBatch
from pianomime.world.hand import hand_points

QUIET = DaggerConfig(noise=0.0)


def _episode(demonstration: Demonstration, number: int, config: DaggerConfig) -> Episode:
    """The episode of one demonstration that can be played."""
    [made] = collect_dagger_episodes([demonstration], [number], config)
    assert isinstance(made, Episode), made
    return made


def test_without_noise_the_expert_plays(two_notes):
    episode = _episode(replace(two_notes, song_id=7), 0, QUIET)
    controller, world = DynamicTracker().start(make_feasible(two_notes.plan)), World()
    for frame in range(len(two_notes.plan)):
        np.testing.assert_allclose(episode.columns["joints"][frame], world.qpos_hands, atol=1e-6)
        ctrl = controller.control(frame, world)
        np.testing.assert_allclose(episode.columns["action"][frame], ctrl, atol=1e-6)
        world.step(ctrl)
    assert episode.song_id == 7
    assert episode.f1 > 0.7


def test_with_noise_the_labels_are_the_experts(two_notes):
    """What it would do in these states, not what was done."""
    one, other = (_episode(two_notes, 0, replace(QUIET, noise=noise)) for noise in (0.05, 0.3))
    assert np.abs(one.columns["joints"] - other.columns["joints"]).max() > 0.02
    controller, world = DynamicTracker().start(make_feasible(two_notes.plan)), World()
    for frame in (5, 20):
        world.data.qpos[88:] = other.columns["joints"][frame]
        np.testing.assert_allclose(
            other.columns["action"][frame], controller.control(frame, world), atol=1e-5
        )


def test_episodes_are_the_same_however_many_are_played_at_once(two_notes):
    clips, config = [replace(two_notes, song_id=song) for song in range(3)], DaggerConfig()
    alone = [one.columns["action"] for one in collect_dagger(clips, config, jobs=1)]
    together = [one.columns["action"] for one in collect_dagger(clips, config, jobs=2)]
    np.testing.assert_array_equal(alone, together)
    assert not np.array_equal(alone[0], alone[1])


@pytest.mark.parametrize("rollout", [False, True])
def test_episodes_are_the_same_however_many_share_a_batch(two_notes, rollout):
    """Bit for bit, also beside a shorter one."""
    score = two_notes.score.clip(0.0, 0.7)
    short = replace(two_notes, score=score, plan=ZeroShotPlanner().plan(score))
    clips = [two_notes, short, two_notes]
    policy = weights_folder() / "low-diff.onnx" if rollout else None
    config = DaggerConfig(rollout_policy=policy, worlds=1)
    alone, pairs, together = (
        list(collect_dagger(clips, replace(config, worlds=worlds), jobs=1)) for worlds in (1, 2, 9)
    )
    for one, two, three in zip(alone, pairs, together, strict=True):
        for columns in ("columns", "events"):
            for name, values in getattr(one, columns).items():
                np.testing.assert_array_equal(getattr(two, columns)[name], values, err_msg=name)
                np.testing.assert_array_equal(getattr(three, columns)[name], values, err_msg=name)
    assert len(alone[1].columns["action"]) < len(alone[0].columns["action"])


def test_an_episode_is_what_a_world_plays(two_notes):
    """Bit for bit, as `perform` records it."""
    made = _episode(two_notes, 0, DaggerConfig(worlds=1))
    feasible = make_feasible(two_notes.plan)
    rng = np.random.default_rng([0, 0])
    spread = noise_spread(DaggerConfig.noise * rng.random())
    rng.integers(2**31, size=2)
    expert = DynamicTracker().start(feasible)
    controller = NoisyController(expert, None, spread, DaggerConfig.noise_correlation, rng)
    columns, _, events = record(controller, two_notes.score)
    for name in ("joints", "velocities", "keys", "pressed"):
        np.testing.assert_array_equal(made.columns[name], columns[name], err_msg=name)
    for name, values in events.items():
        np.testing.assert_array_equal(made.events[name], values, err_msg=name)
    assert len(events["event_time"])


class _Failing(NoisyController):
    """Cannot go on in a frame of the second demonstration."""

    def control(self, frame, world):
        if frame == 5 and self.labels.shape[0] == _Failing.frames:
            raise InputError("the network's action is not what it should be")
        return super().control(frame, world)


def test_one_that_cannot_be_played_to_the_end_costs_no_other(two_notes, monkeypatch):
    score = two_notes.score.clip(0.0, 0.7)
    short = replace(two_notes, score=score, plan=ZeroShotPlanner().plan(score))
    _Failing.frames = len(short.plan)
    alone = [_episode(two_notes, number, QUIET) for number in (0, 2)]
    monkeypatch.setattr(dagger, "NoisyController", _Failing)
    first, failed, last = collect_dagger_episodes([two_notes, short, two_notes], range(3), QUIET)
    assert isinstance(failed, InputError)
    for one, other in zip((first, last), alone, strict=True):
        np.testing.assert_array_equal(one.columns["joints"], other.columns["joints"])


def test_a_group_that_fails_as_a_whole_is_played_one_by_one(two_notes, monkeypatch):
    """As where its process dies for want of memory."""
    sizes = []

    def work(worker, groups, jobs, request):
        answer = dagger.load_dagger_worker(None)
        for group in groups:
            sizes.append(len(group))
            row = {"error": "its process died"} if len(group) > 1 or group.start == 1 else None
            yield group, row or answer(request(group))

    monkeypatch.setattr(dagger, "work", work)
    clips = [
        replace(two_notes, score=replace(two_notes.score, title=title)) for title in ("a", "b", "c")
    ]
    config = replace(QUIET, worlds=2)
    with pytest.warns(UserWarning, match="left out: b: cannot be recorded: its process died"):
        assert [one.name for one in collect_dagger(clips, config, jobs=1)] == ["a", "c"]
    assert sizes == [2, 1, 1, 1]


@pytest.mark.parametrize(
    ("number", "worlds", "jobs", "sizes"),
    [
        (5, 1, 2, [1] * 5),
        (5, 64, 2, [3, 2]),
        (5, 2, 1, [2, 2, 1]),
        (2, 9, 4, [1, 1]),
        (0, 9, 2, []),
    ],
)
def test_no_process_is_idle_while_others_have_several_to_play(number, worlds, jobs, sizes):
    groups = dagger._groups(number, worlds, jobs)
    assert [len(group) for group in groups] == sizes
    assert [each for group in groups for each in group] == list(range(number))


def test_on_another_device_it_is_nearly_the_same(two_notes):
    pytest.importorskip("mujoco_warp", reason="the extra gpu is not installed")
    here, there = (
        collect_dagger_episodes([two_notes] * 2, [0, 1], replace(QUIET, device=device))
        for device in ("cpu", "warp-cpu")
    )
    for one, other in zip(here, there, strict=True):
        apart = np.abs(one.columns["joints"] - other.columns["joints"])
        assert 0.0 < np.median(apart) < 1e-3
        assert abs(one.f1 - other.f1) < 0.1


@pytest.mark.parametrize(("limit", "songs"), [(2, [0, 2]), (4, [0, 1, 2, 3]), (9, [0, 1, 2, 3, 4])])
def test_the_command_plays_as_many_as_are_wanted(two_notes, tmp_path, capsys, limit, songs):
    for number in range(5):
        replace(two_notes, song_id=number).save(tmp_path / f"{number}.npz")
    replace(two_notes, split="test").save(tmp_path / "not for training.npz")
    out = tmp_path / "dagger.zarr"
    cli.main(
        ["collect-dagger", str(tmp_path), "-o", str(out), "--jobs", "1"]
        + ["--max-demonstrations", str(limit)]
    )
    assert f"played: {len(songs)}," in capsys.readouterr().out
    assert [episode["song_id"] for episode in TrajectoryData.open(out).episodes] == songs


@pytest.mark.parametrize(
    "settings",
    [
        {"noise": -1.0},
        {"noise": float("nan")},
        {"noise_correlation": 1.0},
        {"max_demonstrations": -1},
        {"seed": -1},
        {"worlds": 0},
        {"device": "gpu"},
    ],
)
def test_settings_out_of_range_are_refused(settings):
    with pytest.raises(InputError):
        DaggerConfig(**settings)


def test_a_policy_of_another_level_is_refused(two_notes):
    clips = [two_notes]
    weights = weights_folder()
    for config in (
        DaggerConfig(rollout_policy=weights / "high-diff.onnx"),
        DaggerConfig(rollout_policy=weights / "fingers.onnx"),
        DaggerConfig(fingertip_policy=weights / "low-diff.onnx"),
    ):
        with pytest.raises(InputError, match="not a policy"):
            next(collect_dagger(clips, config))


def test_a_fingertip_policy_and_a_rollout_policy_play(two_notes):
    weights = weights_folder()
    config = DaggerConfig(
        rollout_policy=weights / "low-diff.onnx", fingertip_policy=weights / "high-diff.onnx"
    )
    shown, usual = (_episode(two_notes, 0, one) for one in (config, QUIET))
    assert not np.array_equal(shown.columns["fingertips"], usual.columns["fingertips"])
    np.testing.assert_array_equal(shown.columns["goal"], usual.columns["goal"])
    assert np.isfinite(shown.columns["action"]).all()


def test_fingertips_that_are_predicted_are_followed_where_hands_can_be(two_notes):
    """What low levels observe is what the expert follows: smooth, at heights that tell presses."""
    weights = weights_folder()
    config = DaggerConfig(fingertip_policy=weights / "high-diff.onnx", noise=0.0)
    columns = _episode(two_notes, 0, config).columns
    z = columns["fingertips"][..., 2]
    assert set(np.unique(z)) == {np.float32(0.0), np.float32(HOVER_HEIGHT)}
    np.testing.assert_array_equal(z[:, :, 1:] == 0, columns["finger_key"] >= 0)
    away = np.abs(columns["fingertips"] - hand_points(columns["joints"]))[..., 1]
    assert np.median(away) < 0.005


def test_songs_without_demonstrations_are_played_with_predicted_fingertips(tmp_path, capsys):
    folder, out = tmp_path / "songs", tmp_path / "dagger.zarr"
    folder.mkdir()
    score = Score([40, 44], [0.0, 0.5], [0.4, 1.0], [80, 80])
    for name in ("one.mid", "two.mid"):
        score.to_midi(folder / name)
    (folder / "zero.mid").write_bytes(b"MThd")
    (folder / "three.musicxml").write_text("<score-partwise/>")
    policy = str(weights_folder() / "high-diff.onnx")
    cli.main(
        ["collect-dagger", str(folder), "-o", str(out), "--jobs", "1", "--fingertip-policy", policy]
    )
    told = capsys.readouterr()
    assert [told.err.count(name) for name in ("zero.mid", ".musicxml")] == [1, 1]
    assert "played: 2," in told.out
    data = TrajectoryData.open(out)
    assert len({episode["song_id"] for episode in data.episodes}) == 1, "the same music"
    pressed = data.columns(0, ["finger_key"])["finger_key"]
    assert set(np.unique(pressed)) >= {-1, 40, 44}


def test_of_songs_only_those_that_are_played_are_read(tmp_path, capsys):
    Score([40], [0.0], [0.4], [80]).to_midi(tmp_path / "a.mid")
    for name in ("b.mid", "c.mid"):
        (tmp_path / name).write_bytes(b"MThd")
    cli.main(
        ["collect-dagger", str(tmp_path), "-o", str(tmp_path / "one.zarr"), "--jobs", "1"]
        + ["--fingertip-policy", str(weights_folder() / "high-diff.onnx")]
        + ["--max-demonstrations", "1"]
    )
    assert "played: 1," in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("song.mid", [], "name a policy that predicts them with --fingertip-policy"),
        (".", [], "name a policy that predicts them with --fingertip-policy"),
        ("empty", ["--fingertip-policy", "x.onnx"], "holds no demonstrations (.npz)"),
        ("data.zarr", ["--fingertip-policy", "x.onnx"], "is a zarr data set"),
    ],
)
def test_what_holds_no_fingertips_is_refused_in_one_line(
    name, options, message, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    Score([40], [0.0], [0.4], [80]).to_midi(tmp_path / "song.mid")
    for folder in ("empty", "data.zarr"):
        (tmp_path / folder).mkdir()
    (tmp_path / "data.zarr" / ".zgroup").write_text("{}")
    with pytest.raises(SystemExit) as error:
        cli.main(["collect-dagger", name, *options])
    assert error.value.code == 2
    told = capsys.readouterr().err
    assert message in told
    assert len(told.strip().splitlines()) == 1


def test_another_seed_draws_otherwise(two_notes):
    weights = weights_folder()
    config = DaggerConfig(fingertip_policy=weights / "high-diff.onnx", noise=0.0)
    one, again, other = (
        _episode(two_notes, 0, replace(config, seed=seed)).columns["fingertips"]
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one, other)


def test_no_jobs_are_refused(tmp_path, capsys):
    with pytest.raises(SystemExit):
        cli.main(["teach", str(tmp_path), "--jobs", "0"])
    assert "jobs must be 1 or more" in capsys.readouterr().err


def test_a_rollout_policy_that_is_damaged_is_refused(two_notes, tmp_path):
    (tmp_path / "policy.onnx").write_bytes(b"not a network")
    config = DaggerConfig(rollout_policy=tmp_path / "policy.onnx")
    with pytest.raises(InputError, match="damaged"):
        next(collect_dagger([two_notes], config))


def test_where_physics_broke_is_left_out_with_a_word(two_notes, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(OneOfBatch, "blow_ups", property(lambda view: 2 * (view._index == 1)))
        kept, left_out, also = collect_dagger_episodes([two_notes] * 3, [0, 1, 2], QUIET)
    assert isinstance(kept, Episode)
    assert isinstance(also, Episode)
    assert isinstance(left_out, InputError)
    assert "the physics broke in 2 of " in str(left_out)

    def work(worker, numbers, jobs, request):
        answer = dagger.load_dagger_worker(None)
        for number in numbers:
            one = number.start
            yield number, ({"error": "it broke"} if one in broken else answer(request(number)))

    monkeypatch.setattr(dagger, "work", work)
    named = [
        replace(two_notes, score=replace(two_notes.score, title=title)) for title in ("a", "b", "c")
    ]
    broken = {1}
    with pytest.warns(UserWarning, match="left out: b: cannot be recorded: it broke"):
        assert [each.name for each in collect_dagger(named, QUIET)] == ["a", "c"]

    write = Path.write_bytes

    def full(path, content):
        if path.suffix == ".episode":
            raise OSError(28, "No space left on device")
        return write(path, content)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(WorkFailed, match="episodes cannot be kept: No space left"):
            list(collect_dagger(named, QUIET))
    broken = {0, 1, 2}
    with (
        pytest.warns(UserWarning, match="left out"),
        pytest.raises(WorkFailed, match="c: cannot be recorded: it broke"),
    ):
        list(collect_dagger(named, QUIET))


def test_a_plan_in_which_no_finger_presses_is_refused_unless_a_policy_makes_one(
    two_notes, tmp_path
):
    two_notes.score.to_midi(tmp_path / "song.mid")
    resting = songs_without_plan([tmp_path / "song.mid"])
    with pytest.raises(InputError, match="no finger presses a key"):
        next(collect_dagger([two_notes, *resting], QUIET))

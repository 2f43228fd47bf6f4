from __future__ import annotations

import importlib.metadata
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pianomime
from pianomime import InputError, PlannedPlayer, Score, evaluate, excerpt, load_player, songs
from pianomime.cli import main
from pianomime.players import player_names, register_player, registry
from pianomime.players.receding_horizon import RecedingHorizonPlayer
from pianomime.players.registry import player_files, player_settings
from pianomime.policies.methods import bundled_weights, weights_folder
from pianomime.world_names import WORLDS

PLUGIN = """
import pianomime

def make_player(effort, seed, speed=1.0):
    base = pianomime.load_player("zero-shot", effort=0)
    return pianomime.PlannedPlayer(f"mine {speed:g}", base.planner, base.tracker)

def make_nothing(effort, seed):
    return "a player"
"""


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module of somebody else's in the folder where they work."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "their_player", raising=False)
    Path("their_player.py").write_text(PLUGIN)
    return tmp_path / "their_player.py"


def test_a_name_that_nobody_has_gets_the_closest_ones() -> None:
    with pytest.raises(InputError, match=r"no player 'zeroshot'; did you mean 'zero-shot'"):
        load_player("zeroshot")


def test_a_registered_player_is_found_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_registered", {})

    def factory(effort: int, seed: int, tempo: float = 1.0) -> PlannedPlayer:
        base = load_player("zero-shot", effort=0)
        assert isinstance(base, PlannedPlayer)
        return PlannedPlayer(f"mine {effort} {seed} {tempo}", base.planner, base.tracker, effort)

    register_player("mine", factory)
    assert "mine" in player_names()
    assert load_player("mine", 2, 3, tempo=0.5).name == "mine 2 3 0.5"
    with pytest.raises(InputError, match=r"mine: .*tempi"):
        load_player("mine", tempi=0.5)


@pytest.mark.parametrize("name", ["", "a:b", "a/b", "my player", "x.npz"])
def test_names_that_could_not_be_asked_for_are_refused(name: str) -> None:
    with pytest.raises(InputError, match="cannot be called"):
        register_player(name, lambda effort, seed: load_player("zero-shot"))


def test_a_factory_is_named_by_its_module(plugin: Path) -> None:
    player = load_player("their_player:make_player", effort=0, speed=2.0)
    assert player.name == "mine 2"
    assert plugin in player_files("their_player:make_player")


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("no_such_module:make", "no_such_module"),
        ("their_player:no_such_factory", "no_such_factory"),
        ("their_player:PLUGIN.x:y", "their_player"),
        ("their_player:make_nothing", "no pianomime.Player"),
    ],
)
def test_what_is_no_factory_is_one_line(plugin: Path, source: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        load_player(source)
    assert "\n" not in str(error.value)


def test_a_player_of_somebody_else_is_evaluated_without_a_fork(plugin: Path) -> None:
    results = evaluate(
        ["twinkle-twinkle"],
        "their_player:make_player",
        effort=0,
        seconds=2,
        lead_in=0.5,
        jobs=1,
        out="out",
    )
    (row,) = results["songs"]
    assert row["player"] == "mine 1"
    assert row["f1"] > 0.9
    assert row["music"]["note_f1_50"] > 0.9


def test_an_instance_is_evaluated_in_this_process() -> None:
    base = load_player("zero-shot", effort=0)
    assert isinstance(base, PlannedPlayer)
    mine = PlannedPlayer("mine", base.planner, base.tracker)
    results = evaluate(["twinkle-twinkle"], mine, seconds=2, lead_in=0.5)
    assert results["player"] == "mine"
    assert results["songs"][0]["f1"] > 0.9
    assert results["songs"][0]["music"]["note_f1_50"] > 0.9
    with pytest.raises(InputError, match="takes no settings"):
        load_player(mine, planner={"beam": 3})


def test_entry_points_bring_players(monkeypatch: pytest.MonkeyPatch, plugin: Path) -> None:
    point = importlib.metadata.EntryPoint("theirs", "their_player:make_player", registry.GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda group: [point])
    registry._entry_points.cache_clear()
    try:
        assert "theirs" in player_names()
        assert load_player("theirs", effort=0).name == "mine 1"
    finally:
        registry._entry_points.cache_clear()


def test_a_folder_of_weights_is_a_player(tmp_path: Path) -> None:
    for name in ("high-diff", "low-diff"):
        shutil.copy(weights_folder() / f"{name}.onnx", tmp_path)
    assert load_player(tmp_path, 0).name == "two-stage-diff"
    shutil.copy(weights_folder() / "fingers.onnx", tmp_path)
    with pytest.raises(InputError, match="holds weights of several players; name one"):
        load_player(tmp_path)
    assert load_player(tmp_path / "two-stage-diff", 0).name == "two-stage-diff"
    assert {file.parent for file in player_files(tmp_path / "two-stage-diff")} == {tmp_path}


def test_a_level_of_ones_own_plays_with_the_bundled_other_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(weights_folder() / "low-diff.onnx", tmp_path)
    with pytest.warns(UserWarning, match=r"has no high-diff\.onnx: the one that comes with"):
        assert load_player(tmp_path, 0).name == "two-stage-diff"
    with pytest.warns(UserWarning, match="high-diff"):
        files = player_files(tmp_path)
    assert files == [bundled_weights() / "high-diff.onnx", tmp_path / "low-diff.onnx"]
    # A player with neither level there does not come from elsewhere.
    monkeypatch.setenv("PIANOMIME_WEIGHTS", str(tmp_path))
    with pytest.raises(InputError, match=r"fingers\.onnx is not there: train it"):
        load_player("fingers", 0)
    with pytest.raises(InputError, match=r"high-bet\.onnx is not there: train it"):
        load_player("two-stage-bet", 0)
    # Of three stages, those that are missing are lent, too.
    (tmp_path / "low-diff.onnx").unlink()
    shutil.copy(bundled_weights() / "hand-motion.onnx", tmp_path)
    with pytest.warns(UserWarning, match=r"has no (fingering|hand-controls)\.onnx"):
        assert load_player(tmp_path, 0).name == "three-stage"


def test_a_folder_of_something_else_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="neither the folder of a run nor one of weights"):
        load_player(tmp_path)


@pytest.mark.parametrize(("effort", "seed"), [(4, 0), (-1, 0), (0, -1)])
def test_efforts_and_seeds_out_of_range(effort: int, seed: int) -> None:
    with pytest.raises(InputError, match="must be"):
        load_player("zero-shot", effort, seed)


def test_settings_reach_planner_tracker_and_search() -> None:
    player = load_player(
        "zero-shot-20hz", 1, planner={"beam": "7"}, **{"tracker.force": 6, "sampling.rounds": 1}
    )
    assert isinstance(player, PlannedPlayer)
    assert player.planner.config.fingering.beam == 7
    assert player.tracker._tracker.config.force == 6.0
    assert player.tracker.config.rounds == 1


def test_settings_that_are_right_only_together_are_taken() -> None:
    settings = {"horizon.first": 60.0, "horizon.longest": 60, "tracker.shortest": "0.2"}
    player = load_player("zero-shot", effort=0, **settings, **{"tracker.stroke.longest": 0.3})
    assert isinstance(player, RecedingHorizonPlayer)
    assert player.horizon.longest == 60.0
    assert player.tracker.config.stroke.shortest == 0.2


def test_a_setting_changes_what_is_played() -> None:
    score = excerpt(Score.from_midi(songs.path("bach-prelude-c")), seconds=3)
    usual = load_player("zero-shot", 0).play(score)
    weak = load_player("zero-shot", 0, tracker={"force": 0.5}).play(score)
    assert not np.array_equal(usual.ctrl, weak.ctrl)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"planner.beem": 3}, "did you mean 'planner.beam'"),
        ({"painter.beam": 3}, "no setting 'painter.beam'"),
        ({"planner.beam": "many"}, "planner.fingering.beam must be of the kind int"),
        ({"planner.beam": 0}, "beam must be 1"),
        ({"tracker.force": float("nan")}, "force must be 0 or more"),
        ({"sampling.rounds": 0}, "rounds must be 1"),
        ({"speed": 3}, "no setting 'speed'"),
    ],
)
def test_settings_that_make_no_sense_are_one_line(settings: dict, message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        load_player("zero-shot", **settings)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("name", [n for n in player_names() if player_settings(n)])
def test_every_setting_that_is_listed_exists(name: str) -> None:
    from pianomime.players.builtin import SETTINGS
    from pianomime.players.settings import configure

    configs = SETTINGS[name]
    assert configure(player_settings(name), **configs) == tuple(configs.values())


@pytest.mark.parametrize("world", WORLDS)
def test_settings_are_shown_as_they_are_in_a_world(
    world: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the configs with which the player is made there."""
    from pianomime.players import builtin
    from pianomime.players.settings import configure, settings_of

    made: dict[str, Any] = {}

    def noted(settings: dict[str, Any], **configs: Any) -> tuple[Any, ...]:
        made.update(configs)
        return configure(settings, **configs)

    monkeypatch.setattr(builtin, "configure", noted)
    for name in ("zero-shot", "zero-shot-20hz", "zero-shot-ik"):
        made.clear()
        load_player(name, world=world)
        assert player_settings(name, world) == settings_of(**made)
    main(["players", "zero-shot", "--world", world])
    apart = "0.002" if world == "solid" else "0.0"
    assert f"--tracker.apart {apart}\n" in capsys.readouterr().out


def test_settings_of_a_world_that_is_not_there_are_one_line() -> None:
    with pytest.raises(InputError, match="world"):
        player_settings("zero-shot", "moon")


def test_every_public_name_is_there_and_is_listed() -> None:
    for name in pianomime.__all__:
        assert getattr(pianomime, name) is not None
    assert set(dir(pianomime)) == set(pianomime.__all__)
    with pytest.raises(AttributeError):
        pianomime.no_such_name  # noqa: B018


def test_settings_come_to_a_factory_as_on_the_command_line(plugin: Path) -> None:
    from pianomime.commands.player_settings import take_settings

    rest, settings = take_settings(
        ["--player", "their_player:make_player", "--player.speed", "3", "--planner.beam=20"]
    )
    assert rest == ["--player", "their_player:make_player"]
    assert settings == {"speed": 3, "planner.beam": 20}
    assert load_player("their_player:make_player", effort=0, speed=3).name == "mine 3"
    for arguments in (["--planner.beam"], ["--planner.beam", "--effort", "0"]):
        with pytest.raises(InputError, match="needs a value"):
            take_settings(arguments)


def test_a_registered_name_is_played_in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_registered", {})

    def factory(effort: int, seed: int) -> PlannedPlayer:
        base = load_player("zero-shot-ik")
        assert isinstance(base, PlannedPlayer)
        return PlannedPlayer("other", base.planner, base.tracker)

    before = evaluate(["twinkle-twinkle"], effort=0, seconds=2)["mean"]["f1"]
    register_player("zero-shot", factory)
    assert evaluate(["twinkle-twinkle"], effort=0, seconds=2)["mean"]["f1"] < before


@pytest.mark.parametrize("line", ["1 / 0", "import no_such_module", "raise KeyError(3)"])
def test_code_of_others_that_fails_is_one_line(plugin: Path, line: str) -> None:
    plugin.write_text(f"{line}\n\ndef make_player(effort, seed):\n    pass\n")
    with pytest.raises(InputError, match=r"their_player\.py:1|No module named") as error:
        load_player("their_player:make_player")
    assert "\n" not in str(error.value)
    plugin.write_text(f"def make_player(effort, seed):\n    {line}\n")
    monkey = sys.modules.pop("their_player", None)
    with pytest.raises(InputError) as error:
        load_player("their_player:make_player")
    assert "\n" not in str(error.value)
    assert monkey is None


def test_the_file_of_a_module_is_no_module(plugin: Path) -> None:
    with pytest.raises(InputError, match="such as their_player:make_player"):
        load_player("./their_player.py:make_player")


def test_the_files_of_a_player_are_those_that_it_may_use(plugin: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "far_helper.py").write_text("FORCE = 5.0\n\ndef far(): pass\n")
    (tmp_path / "near_helper.py").write_text("SPEED = 1.0\n")
    plugin.write_text("import near_helper\nfrom far_helper import far\n" + PLUGIN)
    sys.path.append(str(elsewhere))
    files = player_files("their_player:make_player")
    assert {file.name for file in files if file.suffix == ".py"} == {
        "their_player.py",
        "near_helper.py",
        "far_helper.py",
    }
    assert {file.stem for file in files} >= {"fingers", "high-diff"}


def test_a_demonstration_plays_its_beginning_too(tmp_path: Path) -> None:
    score = excerpt(Score.from_midi(songs.path("beethoven-ode-to-joy")), seconds=6.0)
    plan = load_player("zero-shot", 0).start(score).plan
    path = tmp_path / "demo.npz"
    pianomime.Demonstration(score, plan).save(path)
    beginning = excerpt(score, seconds=3.0)
    performance = load_player(path, 0).play(beginning)
    assert performance.metrics()["f1"] > 0.8
    with pytest.raises(InputError, match=r"6\.0 s"):
        load_player(path, 0).play(beginning.transpose(1))

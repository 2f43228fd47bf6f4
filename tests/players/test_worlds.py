"""Players play in the world that they are asked to, and performances keep its name."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import made_up
import pianomime.world.hand
import pianomime.world.model
from pianomime import InputError, Performance, PlannedPlayer, Player, Score, load_player
from pianomime.archive import SEAL, write_arrays
from pianomime.evaluation.evaluation import evaluate
from pianomime.plan.demonstration import Demonstration
from pianomime.players import register_player, registry
from pianomime.players.body import body_metrics
from pianomime.players.motion import motion
from pianomime.world_names import WORLDS

PLANNED = ("zero-shot", "zero-shot-20hz", "zero-shot-ik")


def far_apart() -> Score:
    """Two notes that one hand can only play with a leap of five octaves."""
    times = np.array([0.2, 0.5])
    return Score(np.array([44, 84]), times, times + 0.2, np.array([70, 70]), title="far apart")


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize(
    ("name", "effort"), [("zero-shot", 1), ("zero-shot-20hz", 1), ("zero-shot-ik", 0)]
)
def test_all_of_a_player_is_in_its_world(
    name: str, effort: int, world: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So are its hands, what it rehearses in, and what it looks ahead in."""
    asked: set[str] = set()
    compiled, hand_model = pianomime.world.model._compiled, pianomime.world.hand.hand_model

    def recorded(given: str) -> object:
        asked.add(given)
        return compiled(given)

    def recorded_hand(side: pianomime.world.model.Side, given: str) -> object:
        asked.add(given)
        return hand_model(side, given)

    little = {"sampling.variations": 2, "sampling.rounds": 1} if effort else {}
    player = load_player(name, effort, world=world, **little)
    assert player.world == world
    monkeypatch.setattr(pianomime.world.model, "_compiled", recorded)
    monkeypatch.setattr(pianomime.world.hand, "hand_model", recorded_hand)
    assert isinstance(player, PlannedPlayer)
    plan = player.planner.plan(far_apart())
    asked.clear()  # Plans are made of what all worlds share.
    fixed = replace(player, planner=_Planned(plan))
    assert fixed.play(far_apart()).world == world
    assert asked == {world}


class _Planned:
    """Has one plan."""

    def __init__(self, plan: object) -> None:
        self._plan = plan

    def plan(self, score: Score) -> object:
        return self._plan


def test_the_default_is_the_papers_world() -> None:
    for name in (*PLANNED, "fingers", "three-stage"):
        assert load_player(name, 0).world == "paper"
        assert load_player(name, 0, world="paper").world == "paper"


@pytest.mark.parametrize("name", ["fingers", "three-stage"])
def test_policies_play_in_the_other_world_too(name: str) -> None:
    assert load_player(name, 0, world="solid").play(far_apart()).world == "solid"


def test_a_demonstration_is_played_in_the_world_that_is_asked_for(tmp_path: Path) -> None:
    score = far_apart()
    plan = load_player("zero-shot-ik").start(score).plan
    assert plan is not None
    shown = Demonstration(score, plan, "planner")
    for name in ("demonstration", "demonstration-ik"):
        player = load_player(name, 0, world="solid", demonstration=shown)
        assert player.play(score).world == "solid"


def test_worlds_that_are_not_there() -> None:
    with pytest.raises(InputError, match=r"^there is no world 'sold'; did you mean 'solid'"):
        load_player("zero-shot", world="sold")


def test_a_player_of_others_that_knows_no_worlds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_registered", {})

    def factory(effort: int, seed: int) -> Player:
        return load_player("zero-shot-ik")

    def choosing(effort: int, seed: int, world: str = "paper") -> Player:
        return load_player("zero-shot-ik", world=world)

    register_player("theirs", factory)
    register_player("choosing", choosing)
    assert load_player("theirs", world="paper").world == "paper"
    with pytest.raises(InputError, match=r"^theirs: plays in the world 'paper', not in 'solid'"):
        load_player("theirs", world="solid")
    assert load_player("choosing", world="solid").world == "solid"
    made = load_player("zero-shot-ik", world="solid")
    assert load_player(made, world="solid") is load_player(made) is made
    with pytest.raises(InputError, match=r"^zero-shot-ik: plays in the world 'solid', not in 'pap"):
        load_player(made, world="paper")


def test_a_file_keeps_the_world(tmp_path: Path) -> None:
    path = tmp_path / "performance.npz"
    replace(made_up.performance(made_up.score()), world="solid").save(path)
    assert Performance.load(path).world == "solid"
    # One from before there were two was played in the paper's.
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files if name not in ("world", SEAL)}
    write_arrays(path, arrays)
    assert Performance.load(path).world == "paper"
    write_arrays(path, {**arrays, "world": np.array("moon")})
    with pytest.raises(InputError, match="world"):
        Performance.load(path)


def test_a_performance_is_played_again_in_its_world() -> None:
    """The rails of the solid world have a limit, so the same controls lead elsewhere."""
    solid = load_player("zero-shot", 0, world="solid").play(far_apart())
    assert all(frame.same for frame in motion(solid))
    assert not all(frame.same for frame in motion(replace(solid, world="paper")))
    limited = body_metrics(solid)
    assert limited.invalid == ()
    assert limited.rail_force_max is not None
    assert limited.rail_force_max <= 150
    free = body_metrics(load_player("zero-shot", 0, world="paper").play(far_apart()))
    assert free.rail_force_max is not None
    assert free.rail_force_max > 150


def test_an_evaluation_knows_the_world(tmp_path: Path) -> None:
    """What was played in one world is no result of the other."""
    found = {
        world: evaluate(
            "twinkle-twinkle", "zero-shot-ik", world=world, seconds=1.0, jobs=1, out=tmp_path
        )
        for world in (None, "paper", "solid")
    }
    assert [results["world"] for results in found.values()] == ["paper", "paper", "solid"]
    assert [results["songs"][0]["world"] for results in found.values()] == [
        *("paper", "paper", "solid")
    ]
    assert len(list((tmp_path / "songs").glob("*.json"))) == 2
    with pytest.raises(InputError, match="no world 'sold'"):
        evaluate("twinkle-twinkle", "zero-shot-ik", world="sold")

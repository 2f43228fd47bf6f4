"""`evaluate --robust`: the grid, its tables, and songs that are not played twice."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pianomime import evaluate, songs
from pianomime.cli import main
from pianomime.errors import InputError
from pianomime.evaluation import robust_play
from pianomime.evaluation.robust_grid import GRID, NOMINAL, Case
from pianomime.evaluation.robust_play import replayed, tracked
from pianomime.evaluation.robustness import robust_markdown, robustness
from pianomime.players.performance import Performance
from pianomime.track.nominal_tracking import Reference
from pianomime.world.perturbation import Perturbation

SONG = songs.names()[0]


@pytest.fixture(scope="module", autouse=True)
def same_code() -> Iterator[None]:
    """Our code may be edited while the tests run, and results of other code are not reused."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pianomime.evaluation.robustness.program_hash", lambda: "ours")
        yield


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """A song of a second that plays, and one that does not."""
    folder = tmp_path_factory.mktemp("robust")
    (folder / "broken|one.mid").write_text("this is no music")
    asked: list[str | Path] = [SONG, folder / "broken|one.mid"]
    out = folder / "out"
    results = evaluate(asked, effort=0, seconds=1.0, lead_in=0.5, jobs=1, out=out)
    return results, out


@pytest.fixture(scope="module")
def table(found: tuple[dict[str, Any], Path]) -> dict[str, Any]:
    results, out = found
    return robustness(results, out, jobs=1)


@pytest.fixture(scope="module")
def performance(found: tuple[dict[str, Any], Path]) -> Performance:
    results, out = found
    return Performance.load(out / results["songs"][0]["performance"])


def test_the_grid_begins_with_the_nominal_world_and_names_differ() -> None:
    assert GRID[0] is NOMINAL
    assert len({case.name for case in GRID}) == len(GRID)
    assert len({case.perturbation for case in GRID}) == len(GRID)
    # Who looks at nothing minds no noise.
    assert [case.name for case in GRID if case.sensed] == [
        "noise 0.01 rad, 1 mm",
        "noise 0.03 rad, 3 mm",
    ]
    assert not any(case.perturbation.delay for case in GRID if case.summed_up)


def test_in_the_nominal_world_what_is_replayed_is_the_performance(
    performance: Performance,
) -> None:
    again = replayed(performance, NOMINAL)
    for name in ("ctrl", "qpos", "pressed", "event_key", "event_speed"):
        np.testing.assert_array_equal(getattr(again, name), getattr(performance, name))
    for name in ("event_on", "event_off"):  # Sums of the same times in another order.
        np.testing.assert_allclose(getattr(again, name), getattr(performance, name), atol=1e-12)


def test_what_is_replayed_late_sounds_late(performance: Performance) -> None:
    late = replayed(performance, Case("late", Perturbation(delay=0.05)))
    np.testing.assert_array_equal(late.event_key, performance.event_key)
    np.testing.assert_allclose(late.event_on, performance.event_on + 0.05, atol=0.006)


def test_feedback_plans_for_a_delay_and_finds_keys(performance: Performance) -> None:
    reference = Reference.of(performance.ctrl, performance.world)
    for perturbation in (Perturbation(delay=0.05), Perturbation(keys_aside=0.005)):
        heard = tracked(performance, reference, Case("", perturbation))
        np.testing.assert_array_equal(heard.event_key, performance.event_key)
        np.testing.assert_allclose(heard.event_on, performance.event_on, atol=0.02)


def test_a_table_has_all_loops_and_cases(
    found: tuple[dict[str, Any], Path], table: dict[str, Any]
) -> None:
    results, out = found
    assert table == json.loads((out / "robust.json").read_text(encoding="utf-8"))
    row, broken = table["songs"]
    assert set(broken) == {"song", "error"}
    assert table["mean"] == {loop: row[loop] for loop in ("open", "closed")}
    assert list(table["mean"]["closed"]) == [case.name for case in GRID]
    assert list(table["mean"]["open"]) == [case.name for case in GRID if not case.sensed]
    nominal = table["mean"]["open"][NOMINAL.name]
    assert nominal["f1"] == pytest.approx(results["songs"][0]["f1"], abs=1e-6)
    for loop, cases in table["change"].items():
        for name, change in cases.items():
            apart = table["mean"][loop][name]["f1"] - table["mean"][loop][NOMINAL.name]["f1"]
            assert change["f1"] == pytest.approx(apart, abs=2e-6)
    mild = [table["change"]["open"][case.name]["f1"] for case in GRID if case.summed_up]
    assert table["worst_open"]["f1"] == min(mild)

    text = (out / "robust.md").read_text(encoding="utf-8")
    assert text == robust_markdown(table)
    lines = text.splitlines()
    assert len([line for line in lines if line.startswith("|")]) == 2 + len(GRID)
    assert any("failed" in line for line in lines)
    with (out / "robust.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * len(GRID) - 2
    for each in rows:
        assert float(each["f1"]) == row[each["loop"]][each["world"]]["f1"]


def test_finished_songs_are_not_played_again(
    found: tuple[dict[str, Any], Path],
    table: dict[str, Any],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    results, out = found

    def no_work(*arguments: Any) -> Any:
        (waiting,) = (each for each in arguments if isinstance(each, list))
        assert not waiting
        yield from ()

    monkeypatch.setattr("pianomime.evaluation.robustness.work", no_work)
    told: list[tuple[Any, ...]] = []
    again = robustness(results, out, progress=lambda *step: told.append(step))
    assert again == table
    assert told == [("robustness", 2, 2)]


def test_results_of_other_code_are_not_reused(
    found: tuple[dict[str, Any], Path], table: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    results, out = found
    kept = set((out / "robust").glob("*.json"))
    row = {name: table["songs"][0][name] for name in ("song", "open", "closed")}
    played: list[str] = []

    def at_once(function: str, waiting: list[Any], *_: Any) -> Any:
        played.extend(song for _, song, *_ in waiting)
        yield from ((item, row) for item in waiting)

    monkeypatch.setattr("pianomime.evaluation.robustness.work", at_once)
    monkeypatch.setattr("pianomime.evaluation.robustness.program_hash", lambda: "other")
    assert robustness(results, out) == table
    assert played == [SONG]
    for file in set((out / "robust").glob("*.json")) - kept:
        file.unlink()


def test_a_damaged_result_is_made_again(
    found: tuple[dict[str, Any], Path], table: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    results, out = found
    (kept,) = (out / "robust").glob("*.json")
    whole = kept.read_text(encoding="utf-8")
    kept.write_text(whole.replace('"blow_ups": 0', '"blow_ups": 1', 1), encoding="utf-8")
    row = {name: table["songs"][0][name] for name in ("song", "open", "closed")}

    def at_once(function: str, waiting: list[Any], *_: Any) -> Any:
        yield from ((item, row) for item in waiting)

    monkeypatch.setattr("pianomime.evaluation.robustness.work", at_once)
    with pytest.warns(UserWarning, match="damaged"):
        assert robustness(results, out) == table
    assert kept.read_text(encoding="utf-8") == whole


def test_a_song_without_its_performance_says_why(tmp_path: Path) -> None:
    asked = ("player", "effort", "world", "seconds", "lead_in")
    results = {**dict.fromkeys(asked), "songs": [{"song": "gone"}]}
    table = robustness(results, tmp_path)
    assert "deleted" in table["songs"][0]["error"]
    assert not table["mean"]
    assert "failed" in robust_markdown(table)
    with pytest.raises(InputError, match="jobs"):
        robustness(results, tmp_path, jobs=0)


def test_noise_comes_again_and_moves_the_hands(
    performance: Performance, monkeypatch: pytest.MonkeyPatch
) -> None:
    reference = Reference.of(performance.ctrl, performance.world)
    monkeypatch.setattr(robust_play, "keys_aside", lambda world, nominal: 0.0)
    noisy = Case("", Perturbation(joint_noise=0.03, slide_noise=0.003))
    first, second = (tracked(performance, reference, noisy) for _ in range(2))
    np.testing.assert_array_equal(first.qpos, second.qpos)
    assert not np.array_equal(first.qpos, performance.qpos)


@pytest.mark.parametrize("asked", [True, False])
def test_the_command_prints_the_table_if_asked(
    asked: bool,
    found: tuple[dict[str, Any], Path],
    table: dict[str, Any],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    results, out = found
    given: list[Any] = []

    def robust(*arguments: Any, **_: Any) -> dict[str, Any]:
        given.extend(arguments)
        return table

    monkeypatch.setattr("pianomime.evaluation.evaluation.evaluate", lambda *_, **__: results)
    monkeypatch.setattr("pianomime.evaluation.robustness.robustness", robust)
    main(["evaluate", SONG, "-o", str(out), *["--robust"] * asked])
    assert (robust_markdown(table) in capsys.readouterr().out) == asked
    assert given == ([results, out] if asked else [])

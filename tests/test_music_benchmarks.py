"""Commands, tables and pictures of benchmarks/music.py and benchmarks/listening.py."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import made_up
from pianomime import Score
from pianomime.evaluation.summary import summarize
from pianomime.world.touch import TOUCHES

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture
def music(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("music")


@pytest.fixture
def listening(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(BENCHMARKS)
    return importlib.import_module("listening")


def row(f1: float, spread: float | None, phantoms: float = 6.0, lost: int = 1) -> dict[str, Any]:
    voice = {"notes": 10, "never_struck": lost}
    return {
        "song": "made up",
        "notes": 30,
        "dropped_notes": 3,
        "f1": 0.9,
        "music": {
            "note_f1_50": f1,
            "note_f1_25": 0.5,
            "note_f1_10": 0.25,
            "note_offset_f1_50": 0.4,
            "velocity_f1": 0.3,
            "phantoms_per_minute": phantoms,
            "restruck": None,
            "chord_spread_p90_ms": spread,
            "chord_spread_wanted_p90_ms": spread,
            "onset_error_ms": [-10.0, 5.0, 20.0],
            "melody": voice,
            "bass": voice,
            "inner": {"notes": 0, "never_struck": 0},
        },
    }


SETS = {
    "modern": [row(0.96, 15.0), row(1.0, None, lost=3)],
    "pop": [row(0.5, 30.0), {"song": "broken", "error": "no notes"}],
}


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_the_command_line_takes_players_and_lead_ins(music: ModuleType) -> None:
    asked = music.options().parse_args(
        ["--players", "zero-shot:0", "weights/mine:3", "--lead-in", "0", "0.5", "--sets", "touch"]
    )
    assert [(each.player, each.effort) for each in asked.players] == [
        ("zero-shot", 0),
        ("weights/mine", 3),
    ]
    assert asked.lead_in == [0.0, 0.5]
    assert asked.sets == ["touch"]
    assert not asked.rtf
    assert not asked.ablate


@pytest.mark.parametrize("wrong", [["--players", "zero-shot"], ["--players", ":1"],
                                   ["--players", "zero-shot:4"], ["--rtf", "--ablate"],
                                   ["--sets", "nothing"]])  # fmt: skip
def test_what_cannot_be_played_is_refused(music: ModuleType, wrong: list[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        music.options().parse_args(wrong)


def test_a_song_of_two_players_has_two_folders(music: ModuleType) -> None:
    names = {music.Playing("zero-shot", effort, lead).name for effort in (0, 1) for lead in (0, 1)}
    assert len(names) == 4


def test_rows_of_real_summaries_have_all_that_tables_show(music: ModuleType) -> None:
    real = summarize(made_up.performance(made_up.score(seconds=2.0)))
    head, rules, *body = music.music_table({"any": [real]})
    assert head == "|  | any (1) |"
    assert len(body) == len(music.MEASURES) + len(music.COUNTS)
    assert music.ablation_table([real], {"part": ("gone", [real])})
    assert rules == "| --- | ---: |"


def test_tables_have_means_of_what_was_measured_and_sums_of_counts(music: ModuleType) -> None:
    head, _, *body = music.music_table(SETS)
    assert cells(head) == ["", "modern (2)", "pop (2)"]
    shown = {label: values for label, *values in map(cells, body)}
    assert shown["note F1, 50 ms"] == ["0.980", "0.500"]
    assert shown["chord spread, p90 [ms]"] == ["15 (1 of 2)", "30"]
    assert shown["repeated notes struck again"] == ["- (0 of 2)", "- (0 of 1)"]
    assert shown["onset error, p5, p50, p95 [ms]"] == ["-10, +5, +20"] * 2
    assert shown["left out by the planner"] == ["6 of 60 (10.0%)", "3 of 30 (10.0%)"]
    assert shown["never struck: melody"] == ["4 of 20 (20.0%)", "1 of 10 (10.0%)"]
    assert shown["never struck: inner voices"] == ["0 of 0 (0.0%)"] * 2
    assert shown["failed"] == ["0", "1"]


def test_nothing_failed_needs_no_row(music: ModuleType) -> None:
    assert "failed" not in "".join(music.music_table({"modern": SETS["modern"]}))


def test_goals_are_compared_with_means_in_either_direction(music: ModuleType) -> None:
    lines = [cells(line) for line in music.goals_table(SETS)[2:]]
    verdicts = {(label, where): verdict for label, where, *_, verdict in lines}
    assert verdicts["note F1, 50 ms", "modern"] == "aim reached"
    assert verdicts["note F1, 50 ms", "pop"] == "missed"
    assert verdicts["chord spread, p90 [ms]", "modern"] == "reached"
    assert verdicts["chord spread, p90 [ms]", "pop"] == "missed"
    assert verdicts["phantom notes a minute", "modern"] == "missed"
    assert verdicts["repeated notes struck again", "pop"] == "not measured"
    assert {where for _, where in verdicts} == {"modern", "pop"}


def test_a_part_is_worth_what_is_lost_without_it(music: ModuleType) -> None:
    full = [row(0.9, 10.0), row(0.8, None), row(0.7, 20.0)]
    less = [row(0.6, 14.0, 12.0), row(0.9, 50.0, 12.0), row(0.7, None, 12.0)]
    head, _, whole, without = map(cells, music.ablation_table(full, {"search": ("none", less)}))
    assert dict(zip(head, whole, strict=True))["note F1, 50 ms"] == "0.800"
    found = dict(zip(head, without, strict=True))
    assert (found["part"], found["without it"]) == ("search", "none")
    assert found["note F1, 50 ms"] == "0.733 (-0.067)"
    assert found["phantom notes a minute"] == "12.0 (+6.0)"
    # Only the first song has a spread with and without it.
    assert found["chord spread, p90 [ms]"] == "32 (+4)"
    assert found["repeated notes struck again"] == "-"
    assert found["helps : harms"] == "1 : 1"


def test_one_velocity_is_planned_for_all_notes(music: ModuleType) -> None:
    class Planner:
        def plan(self, score: Score) -> Any:
            return score

    score = made_up.score()
    planned = music._OneVelocity(Planner()).plan(score)
    assert set(planned.velocity) == {round(float(np.median(score.velocity)))}
    assert len(set(score.velocity)) > 1
    np.testing.assert_array_equal(planned.onset, score.onset)


def test_songs_are_of_their_sets_and_none_that_is_reported_is_for_development(
    music: ModuleType, shared: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PIANOMIME_SHARED", str(shared))
    sizes = {name: len(music.songs_of(name)) for name in music.SETS}
    assert sizes == {
        "modern": 12, "Etude-12": 12, "pop": 12, "GiantMIDI": 12, "GiantMIDI-100": 100,
    }  # fmt: skip
    touch = music.songs_of("touch")
    pop, giant = music.songs_of("pop"), music.songs_of("GiantMIDI-100")
    assert len(set(touch)) == 12
    assert set(touch[:6]) <= set(pop)
    assert set(touch[6:]) <= set(giant)
    assert min(map(music.velocity_spread, touch[:6])) >= max(
        map(music.velocity_spread, set(pop) - set(touch))
    )
    development = music.development_songs()
    assert len(development) == 7
    reported = {song for name in (*music.SETS, "touch") for song in music.songs_of(name)}
    assert not reported & set(development)


def heard(listening: ModuleType) -> Any:
    """Five notes a second apart: three struck ever later, one not, one too hard; and a phantom."""
    score = Score(
        key=np.array([40, 41, 42, 43, 44]),
        onset=np.arange(5.0),
        offset=np.arange(5.0) + 0.4,
        velocity=np.full(5, 60),
        title="made up",
    )
    on = np.array([0.02, 1.04, 2.1, 2.5, 4.01])
    velocity, key = np.array([62, 68, 60, 30, 80]), np.array([40, 41, 42, 50, 44])
    performance = replace(
        made_up.performance(score, planned=False),
        event_key=key,
        event_on=on,
        event_off=on + 0.2,
        event_speed=TOUCHES["goebl-bresin"].speed_of(velocity, key),
    )
    return listening.Heard.of(performance, "made up, effort 2")


def test_a_picture_tells_what_became_of_each_note(listening: ModuleType) -> None:
    made = heard(listening)
    right, near, far, phantom = range(4)
    assert made.kind.tolist() == [right, near, far, phantom, right]
    assert made.note.tolist() == [0, 1, 2, -1, 4]
    assert made.struck.tolist() == [True, True, True, False, True]
    assert made.summary(0.0, 5.0) == (
        "of 5 notes, 2 within 25 ms, 3 within 50 ms (2 with the right touch); phantoms: 1"
    )
    # A note is where it is wanted, also where it is struck later.
    assert made.summary(1.02, 3.0) == (
        "of 1 notes, 0 within 25 ms, 0 within 50 ms (0 with the right touch); phantoms: 1"
    )


def test_a_picture_is_drawn_and_small(listening: ModuleType, tmp_path: Path) -> None:
    made = heard(listening)
    path = tmp_path / "images" / "picture.png"
    listening.save(listening.draw("A title for 5 $", (made, made), (0.0, 5.0)), path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert path.stat().st_size < 200_000


def test_pictures_are_of_two_players(listening: ModuleType) -> None:
    asked = listening.options().parse_args([])
    assert (asked.before.player, asked.before.effort) == ("zero-shot-20hz", 1)
    assert (asked.after.player, asked.after.effort) == ("zero-shot", 1)
    assert asked.before.lead_in == asked.after.lead_in > 0
    assert asked.pieces == [*listening.PIECES]

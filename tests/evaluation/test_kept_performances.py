"""What `evaluate` keeps beside the row of a song, and the songs that are demonstrations."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from pianomime import Performance, evaluate, load_player, songs
from pianomime.errors import InputError
from pianomime.evaluation.diagnose import diagnose
from pianomime.music import Score
from pianomime.plan import ZeroShotPlanner
from pianomime.plan.demonstration import Demonstration
from pianomime.players.casting import Casting

SONG = songs.names()[0]


@pytest.fixture
def demo(tmp_path: Path) -> Path:
    """A demonstration that begins with silence, and whose plan is nobody else's."""
    score = Score(
        key=np.array([40, 44, 47]),
        onset=np.array([0.52, 1.0, 1.6]),
        offset=np.array([0.9, 1.4, 2.3]),
        velocity=np.array([80, 80, 80]),
        pedal=np.zeros((0, 2)),
        title="three notes",
    )
    path = tmp_path / "demo.npz"
    Demonstration(score, ZeroShotPlanner().plan(score)).save(path)
    return path


def test_each_row_names_its_performance_which_need_not_stay(tmp_path: Path) -> None:
    out = tmp_path / "out"
    (tmp_path / "broken.mid").write_text("this is no music")
    asked = [SONG, str(tmp_path / "broken.mid")]
    first = evaluate(asked, "zero-shot-ik", seconds=1.0, jobs=1, out=out)
    row, broken = first["songs"]
    kept = out / row["performance"]
    assert kept == next((out / "songs").glob("*.json")).with_suffix(".npz")
    assert "performance" not in broken
    assert len(list((out / "songs").iterdir())) == 2

    performance = Performance.load(kept)
    assert row["f1"] == pytest.approx(performance.metrics()["f1"], abs=1e-6)
    assert diagnose(performance).wanted == row["causes"]["wanted"]

    written = kept.stat().st_mtime_ns
    assert evaluate(asked, "zero-shot-ik", seconds=1.0, jobs=1, out=out) == first
    assert kept.stat().st_mtime_ns == written
    kept.unlink()
    (again, _) = evaluate(asked, "zero-shot-ik", seconds=1.0, jobs=1, out=out)["songs"]
    assert {**again, "performance": row["performance"]} == row
    assert not kept.exists()


def test_nothing_is_kept_without_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (row,) = evaluate(SONG, "zero-shot-ik", seconds=1.0, jobs=1)["songs"]
    assert "performance" not in row
    assert not os.listdir()


def test_a_player_that_exists_here_alone_leaves_its_performances_too(tmp_path: Path) -> None:
    player = load_player("zero-shot-ik")
    (row,) = evaluate(SONG, player, seconds=1.0, out=tmp_path)["songs"]
    assert Performance.load(tmp_path / row["performance"]).player == "zero-shot-ik"


def test_demonstrations_are_played_by_their_own_plan(demo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    midi = songs.path(SONG)
    results = evaluate([demo, midi], "demonstration-ik", seconds=1.5, jobs=1, out=out)
    shown, refused = results["songs"]
    assert shown["song"] == "demo"
    assert shown["player"] == "demonstration-ik"
    assert "demonstrations" in refused["error"]
    performance = Performance.load(out / shown["performance"])
    excerpt = Demonstration.load(demo).excerpt(0.0, 1.5)
    assert performance.plan is not None
    np.testing.assert_array_equal(performance.plan.fingertips, excerpt.plan.fingertips)
    assert results == evaluate([demo, midi], "demonstration-ik", seconds=1.5, jobs=1, out=out)


def test_plans_of_demonstrations_take_no_lead_in(demo: Path, tmp_path: Path) -> None:
    shown = Demonstration.load(demo)
    made = load_player("demonstration-ik", demonstration=shown)
    for player in ("demonstration", "demonstration-ik", str(demo), made):
        with pytest.raises(InputError, match="plays music of its own, from the first note on"):
            evaluate(demo, player, lead_in=0.5, out=tmp_path / "out")
        casting = Casting.of(player, 0, 0)
        assert not casting.takes_lead_in
        _, score = casting.cast(demo, 0.0, 5.0, 0.0)
        np.testing.assert_array_equal(score.onset, shown.excerpt().score.onset)
    assert not (tmp_path / "out").exists()
    # What plays a demonstration's notes by a plan of its own can wait.
    casting = Casting.of("zero-shot-ik", 0, 0)
    assert casting.takes_lead_in
    (_, score), (_, later) = (casting.cast(demo, 0.0, 1.5, lead_in) for lead_in in (0.0, 0.5))
    np.testing.assert_array_equal(later.roll(), np.pad(score.roll(), ((10, 0), (0, 0))))


def test_other_players_play_the_notes_of_a_demonstration(demo: Path, tmp_path: Path) -> None:
    results = evaluate([demo, SONG], "zero-shot-ik", seconds=1.5, jobs=1, out=tmp_path / "out")
    row, other = results["songs"]
    performance = Performance.load(tmp_path / "out" / row["performance"])
    assert performance.score.title == "three notes"
    np.testing.assert_array_equal(
        performance.score.roll(), Demonstration.load(demo).excerpt(0.0, 1.5).score.roll()
    )
    assert "f1" in other


def test_what_is_no_demonstration_is_a_row_and_the_others_go_on(demo: Path, tmp_path: Path) -> None:
    damaged, played = tmp_path / "damaged.npz", tmp_path / "played.npz"
    damaged.write_bytes(demo.read_bytes()[:-100])
    load_player("zero-shot-ik").play(Demonstration.load(demo).score).save(played)
    rows = evaluate([damaged, played, demo], "demonstration-ik", jobs=1)["songs"]
    assert "demonstration" in rows[0]["error"]
    assert f"pianomime report {played}" in rows[1]["error"]
    assert "f1" in rows[2]


def test_players_of_demonstrations_need_some() -> None:
    with pytest.raises(InputError, match=r"plays demonstrations \(\.npz\), and none is given"):
        evaluate(SONG, "demonstration")


def test_settings_of_players_of_demonstrations_are_checked_at_once(demo: Path) -> None:
    with pytest.raises(InputError, match="nothing"):
        evaluate(demo, "demonstration-ik", settings={"tracker.nothing": 1})

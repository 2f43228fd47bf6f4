from __future__ import annotations

import contextlib
import io
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import made_up
import pianomime.players.performance
from pianomime import Performance
from pianomime.errors import InputError
from pianomime.music import music_metrics
from pianomime.plan import FingertipPlan


def assert_same(one: object, other: object) -> None:
    """Equal in every field, bit for bit, types of arrays included."""
    assert type(one) is type(other)
    for field in fields(one):  # type: ignore[arg-type]
        mine, its = getattr(one, field.name), getattr(other, field.name)
        if isinstance(mine, np.ndarray):
            assert mine.dtype == its.dtype
            np.testing.assert_array_equal(mine, its)
        elif hasattr(mine, "__dataclass_fields__"):
            assert_same(mine, its)
        else:
            assert mine == its


@pytest.mark.parametrize("planned", [True, False])
def test_what_is_saved_comes_back_exactly(tmp_path: Path, planned: bool) -> None:
    performance = made_up.performance(made_up.score(title="Für Elise"), planned=planned)
    performance.save(tmp_path / "performance.npz")
    assert_same(Performance.load(tmp_path / "performance.npz"), performance)
    assert [file.name for file in tmp_path.iterdir()] == ["performance.npz"]


def test_a_failed_save_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "performance.npz"
    made_up.performance(made_up.score()).save(path)
    before = path.read_bytes()

    def interrupted(target: Path, _: object) -> None:
        Path(target).write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(pianomime.players.performance, "write_arrays", interrupted)
    with pytest.raises(KeyboardInterrupt):
        made_up.performance(made_up.score(seed=1)).save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["performance.npz"]


def npy() -> bytes:
    file = io.BytesIO()
    np.save(file, np.arange(3))
    return file.getvalue()


@pytest.mark.parametrize("content", [b"", b"text", b"PK\x03\x04 half a zip", npy()])
def test_what_is_no_performance_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "performance.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r": not a performance, or a damaged one$"):
        Performance.load(path)


@given(at=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7), cut=st.booleans())
@settings(max_examples=60, deadline=None)
def test_a_damaged_file_is_refused_or_harmless(
    tmp_path_factory: pytest.TempPathFactory, at: float, bit: int, cut: bool
) -> None:
    path = tmp_path_factory.mktemp("damaged") / "performance.npz"
    made_up.performance(made_up.score(notes=5, seconds=1.0)).save(path)
    content = bytearray(path.read_bytes())
    place = int(at * len(content))
    if cut:
        del content[place:]
    else:
        content[place] ^= 1 << bit
    path.write_bytes(content)
    with contextlib.suppress(InputError):
        Performance.load(path).metrics()


@pytest.mark.parametrize("name", ["ctrl", "pressed", "pedal", "plan_finger_key", "score_key"])
def test_arrays_that_do_not_fit_together_are_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "performance.npz"
    made_up.performance(made_up.score()).save(path)
    with np.load(path) as file:
        arrays = dict(file)
    arrays[name] = arrays[name][:-1]
    np.savez(path, **arrays)
    with pytest.raises(InputError, match="not a performance"):
        Performance.load(path)


def test_a_plan_for_another_score_does_not_fit() -> None:
    performance = made_up.performance(made_up.score())
    with pytest.raises(ValueError, match="59 notes"):
        replace(performance, plan=made_up.plan(made_up.score(notes=59)))


def test_other_arrays_and_other_versions_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", numbers=np.arange(3))
    with pytest.raises(InputError, match="not a performance"):
        Performance.load(tmp_path / "other.npz")
    np.savez(tmp_path / "newer.npz", version=np.array(99))
    with pytest.raises(InputError, match="version 99"):
        Performance.load(tmp_path / "newer.npz")
    with pytest.raises(FileNotFoundError):
        Performance.load(tmp_path / "missing.npz")


def test_perfect_playing_scores_one_and_gives_the_score_back() -> None:
    score = made_up.score(notes=20, seed=3)
    performance = made_up.performance(score, mistakes=0.0)
    assert performance.metrics()["f1"] == 1.0
    assert "pedal_f1" not in performance.metrics()  # The score worked the pedal.
    assert replace(performance, works_pedal=True).metrics()["pedal_f1"] == 1.0
    played = performance.played()
    # A score that ends within a frame is played to the end of it.
    frames = min(played.frames(), score.frames())
    np.testing.assert_array_equal(played.roll()[:frames], score.roll()[:frames])
    np.testing.assert_array_equal(np.sort(played.velocity), np.sort(performance.event_velocity))
    np.testing.assert_allclose(played.pedal, score.pedal)


def test_silence_is_a_performance_too() -> None:
    performance = made_up.performance(made_up.score(), mistakes=1.1)
    assert not performance.pressed.any()
    metrics = performance.metrics()
    assert metrics["recall"] < 0.5
    assert metrics["onset_f1"] == 0.0
    assert len(performance.played()) == 0


def test_a_plan_of_another_length_is_not_accepted() -> None:
    plan = made_up.plan(made_up.score())
    with pytest.raises(ValueError, match="finger_key"):
        FingertipPlan(plan.fingertips[1:], plan.finger_key, plan.note_hand, plan.note_finger)


def test_lifts_of_a_pedal_that_is_the_scores_own_are_not_measured() -> None:
    score = made_up.score()
    copied = made_up.performance(score)
    played = replace(copied, works_pedal=True)
    assert copied.music().pedal_lifts_kept is None
    assert played.music() == music_metrics(score, played.played())
    assert played.music().pedal_lifts_kept is not None


@pytest.mark.parametrize("controls", [0, 3, 4])
def test_a_frame_has_as_many_controls_as_physics_steps_allow(controls: int) -> None:
    performance = made_up.performance(made_up.score())
    with pytest.raises(ValueError, match=f"cannot have {controls} controls"):
        replace(performance, ctrl=np.zeros((len(performance), controls, 46)))

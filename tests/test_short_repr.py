"""Objects that hold arrays are printed in one short line, which says what one wants to know."""

import ast
import re
from pathlib import Path

import numpy as np
import pytest

import pianomime
from pianomime import songs
from pianomime.plan.fingering import Fingering

SOURCE = Path(pianomime.__file__).parent


@pytest.fixture(scope="module")
def performance() -> pianomime.Performance:
    score = pianomime.Score.from_midi(songs.path("twinkle-twinkle")).clip(0, 2)
    return pianomime.load_player("zero-shot", effort=0).play(score)


def test_a_score_says_its_title_length_and_notes(performance: pianomime.Performance) -> None:
    assert re.fullmatch(r"<Score 'twinkle-twinkle', 2\.0 s, \d+ notes>", repr(performance.score))


def test_a_performance_says_who_played_what_and_how_well(
    performance: pianomime.Performance,
) -> None:
    f1 = f"F1 {performance.metrics()['f1']:.3f}"
    text = repr(performance)
    assert re.fullmatch(
        r"<Performance 'twinkle-twinkle', player 'zero-shot', 2\.\d s, \d+ notes, F1 .*>", text
    )
    assert f1 in text


def test_plans_demonstrations_and_diagnoses_are_short(performance: pianomime.Performance) -> None:
    assert performance.plan is not None
    plan = performance.plan
    assert re.fullmatch(r"<FingertipPlan 2\.\d s, \d+ notes \(0 dropped\)>", repr(plan))
    made = pianomime.Demonstration(performance.score, plan, source="a video")
    assert re.fullmatch(
        r"<Demonstration 'twinkle-twinkle', 2\.\d s, \d+ notes, source 'a video'>", repr(made)
    )
    assert re.fullmatch(
        r"<Diagnosis 'twinkle-twinkle', player 'zero-shot', \d+ faults?, \d+ of \d+ frames>",
        repr(pianomime.diagnose(performance)),
    )


def test_other_arrays_are_told_by_their_shape() -> None:
    fingering = Fingering(*(np.zeros(1000, np.int64) for _ in Fingering.__dataclass_fields__))
    text = repr(fingering)
    assert "hand=(1000,) int64" in text
    assert "array" not in text
    assert "\n" not in text


def test_odd_titles_stay_in_one_line(performance: pianomime.Performance) -> None:
    score = pianomime.Score.from_roll(performance.pressed, title="a\nb\x1b[31m")
    assert "\n" not in repr(score)
    assert "\x1b" not in repr(score)


@pytest.mark.parametrize("name", ["zero-shot", "two-stage-diff"])
def test_players_say_their_name_and_effort(name: str) -> None:
    assert re.fullmatch(rf"<\w+Player '{name}', effort 1>", repr(pianomime.load_player(name)))


def _is_dataclass(node: ast.ClassDef) -> bool:
    return any("dataclass" in ast.unparse(each) for each in node.decorator_list)


def test_every_public_dataclass_with_arrays_has_a_short_text() -> None:
    # Its source is read: importing all modules takes long.
    checked = 0
    for file in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.ClassDef) or node.name.startswith("_"):
                continue
            fields = [each for each in node.body if isinstance(each, ast.AnnAssign)]
            arrays = [
                each
                for each in fields
                if re.match(r"(NDArray|FloatArray)", ast.unparse(each.annotation))
            ]
            if _is_dataclass(node) and arrays:
                checked += 1
                body = "\n".join(ast.unparse(each) for each in node.body)
                assert "__repr__" in body, f"{file.name}: {node.name}"
                assert "short_repr" in body, f"{file.name}: {node.name}"
    assert checked > 15

"""Messages for names that nothing has, and of errors of other libraries."""

from __future__ import annotations

import pytest

from pianomime.errors import InputError, closest, reason_of, unknown_name


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("zeroshot", "; did you mean 'zero-shot'?"),
        ("ZERO-SHOT", "; did you mean 'zero-shot'?"),
        ("two-stage", "; did you mean 'two-stage-diff' or 'two-stage-bet'?"),
        ("xylophone", ""),
    ],
)
def test_closest_names(name: str, hint: str) -> None:
    known = ["zero-shot", "fingers", "two-stage-diff", "two-stage-bet"]
    assert closest(name, known) == hint


def test_no_name_is_close_where_there_are_none() -> None:
    assert closest("anything", []) == ""


def test_unknown_name_lists_all_names() -> None:
    error = unknown_name("player", "zeroshot", ["zero-shot", "fingers"])
    assert isinstance(error, InputError)
    assert str(error) == (
        "there is no player 'zeroshot'; did you mean 'zero-shot'? there are: zero-shot, fingers"
    )
    far = unknown_name("player", "xylophone", ["zero-shot", "fingers"])
    assert str(far) == "there is no player 'xylophone'; there are: zero-shot, fingers"


@pytest.mark.parametrize(
    ("error", "reason"),
    [(ValueError("one\ntwo"), "one"), (KeyError(), "KeyError"), (ValueError("x" * 999), "x" * 200)],
)
def test_the_reason_of_an_error_is_one_line(error: Exception, reason: str) -> None:
    assert reason_of(error) == reason

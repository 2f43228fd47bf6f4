"""Schemas: a list of numbers has the rules of its numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pianomime.errors import InputError
from pianomime.schema import Field, check_json


def test_numbers_of_a_list_may_be_infinite_where_one_may() -> None:
    field = Field("float", ("N",), least=0, may_be_infinite=True)
    check_json([1.0, math.inf], field, "seconds")
    with pytest.raises(InputError, match="seconds must be finite"):
        check_json([1.0, math.inf], replace(field, may_be_infinite=False), "seconds")
    with pytest.raises(InputError, match="seconds must be 0 to inf"):
        check_json([-1.0], field, "seconds")


def test_null_stands_for_a_whole_value_where_it_may() -> None:
    field = Field("float", (3,), may_be_null=True)
    check_json(None, field, "error")
    check_json([0.0, 1.0, 2.0], field, "error")
    with pytest.raises(InputError, match="error must be float, not None"):
        check_json([0.0, None, 2.0], field, "error")
    with pytest.raises(InputError, match="error must be a list of 3"):
        check_json(None, replace(field, may_be_null=False), "error")

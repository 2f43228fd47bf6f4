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

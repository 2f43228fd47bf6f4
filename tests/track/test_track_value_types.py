from __future__ import annotations

import pianomime.track
from value_types import check_value_types


def test_values_do_not_change() -> None:
    check_value_types(pianomime.track)

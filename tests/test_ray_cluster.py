"""Work on a Ray cluster gives what the processes of this machine give."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

import pianomime
from pianomime.errors import InputError
from pianomime.workers import Answer, work

pytest.importorskip("ray", reason="the extra scale is not installed")

from pianomime.ray_cluster import on_cluster

LOADER = f"{__name__.rpartition('.')[2]}:load_shares"


def load_shares(setup: dict[str, int]) -> Answer:
    """Divides by a request; what was loaded counts its answers."""
    answers = 0

    def share(request: dict[str, Any]) -> dict[str, Any]:
        nonlocal answers
        answers += 1
        return {"share": setup["whole"] / request["parts"], "answers": answers, "pid": os.getpid()}

    return share


@pytest.fixture(scope="module")
def local() -> Iterator[str]:
    """One cluster of a single process for all tests: each start of one takes seconds."""
    import ray

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_ENABLE_UV_RUN_RUNTIME_ENV", "0")
        patch.setenv("PYTHONPATH", os.pathsep.join([os.path.dirname(__file__), *_path()]))
        ray.init(address="local", num_cpus=1, log_to_driver=False, include_dashboard=False)
        try:
            yield "local"
        finally:
            ray.shutdown()


def _path() -> list[str]:
    given = os.environ.get("PYTHONPATH", "")
    return given.split(os.pathsep) if given else []


def test_rows_come_back_and_what_fails_is_a_row(local: str) -> None:
    requests = {"half": {"parts": 2}, "none": {"parts": 0}, "third": {"parts": 3}}
    with closing(
        on_cluster(LOADER, requests, local, {"whole": 6}, requests.__getitem__)
    ) as answered:
        rows = dict(answered)
    assert (rows["half"]["share"], rows["third"]["share"]) == (3.0, 2.0)
    assert rows["none"]["error"].startswith("ZeroDivisionError")
    # It was loaded once: in the one process there is.
    good = [rows["half"], rows["third"]]
    assert len({row["pid"] for row in good}) == 1
    assert {row["pid"] for row in good} != {os.getpid()}
    assert max(row["answers"] for row in good) == len(requests)


def test_what_cannot_be_loaded_fails_as_in_a_process(local: str) -> None:
    rows = {}
    for name, answered in (
        ("ray", on_cluster("nowhere:load", [1], local)),
        ("processes", work("nowhere:load", [1], 1)),
    ):
        with closing(answered):
            rows[name] = dict(answered)[1]["error"]
    assert rows["ray"].partition(" (")[0] == rows["processes"].partition(" (")[0]
    assert "nowhere" in rows["ray"]


def test_songs_are_evaluated_as_without_it(local: str) -> None:
    given = {"player": "zero-shot-20hz", "effort": 0, "seconds": 1.0}
    here = pianomime.evaluate("twinkle-twinkle", jobs=1, **given)
    there = pianomime.evaluate("twinkle-twinkle", ray=local, **given)
    timed = {"plan_seconds", "simulate_seconds", "realtime_factor"}
    (one,), (other,) = here["songs"], there["songs"]
    assert "error" not in one
    for name in set(one) - timed:
        assert one[name] == other[name], name


def test_a_player_of_this_process_is_refused() -> None:
    player = pianomime.load_player("zero-shot-20hz", 0)
    with pytest.raises(InputError, match="other machines cannot load") as error:
        pianomime.evaluate("twinkle-twinkle", player, ray="local")
    assert "\n" not in str(error.value)

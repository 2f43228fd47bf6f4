from __future__ import annotations

import threading

import pytest

from pianomime.video.film.read_ahead import ahead


def test_everything_comes_in_order():
    assert list(ahead(iter(range(50)))) == list(range(50))
    assert list(ahead(iter([]))) == []


def test_no_more_than_a_few_are_made_ahead():
    made = []
    before = threading.active_count()

    def items():
        for number in range(100):
            made.append(number)
            yield number

    some = ahead(items())
    for _ in range(10):
        next(some)
    some.close()
    assert len(made) < 20
    assert threading.active_count() == before


def test_an_error_comes_where_it_is_due():
    def items():
        yield 1
        raise ValueError("broken")

    some = ahead(items())
    assert next(some) == 1
    with pytest.raises(ValueError, match="broken"):
        next(some)

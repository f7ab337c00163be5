"""Mapping ahead: order, bounds, errors."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest

from sfm_front.ahead import map_ahead


def test_results_come_in_the_items_order_whatever_finishes_first():
    def slow_first(item: int) -> int:
        time.sleep(0.05 if item == 0 else 0)
        return item * item

    assert list(map_ahead(slow_first, range(7), num_threads=3)) == [n * n for n in range(7)]


def test_no_more_items_are_taken_than_twice_the_threads_ahead():
    taken = []

    def items() -> Iterator[int]:
        for number in range(100):
            taken.append(number)
            yield number

    results = map_ahead(lambda item: item, items(), num_threads=2)
    assert next(results) == 0
    assert len(taken) == 4
    assert next(results) == 1
    assert len(taken) == 5
    results.close()


def test_it_works_on_several_threads_at_once():
    meeting = threading.Barrier(2, timeout=10)
    assert len(list(map_ahead(lambda _: meeting.wait(), range(2), num_threads=2))) == 2


def test_an_error_reaches_the_caller_in_its_turn():
    def fail_at_two(item: int) -> int:
        if item == 2:
            raise ValueError("two")
        return item

    results = map_ahead(fail_at_two, range(5), num_threads=2)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ValueError, match="two"):
        next(results)

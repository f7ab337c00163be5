"""Mapping ahead: order, bounds, errors, and the limits on libraries meanwhile."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest
from helpers.library_threads import library_threads, needs_blas, several_threads

from sfm_front.runtime.prefetch import prefetch
from sfm_front.types import NotYet


def test_results_come_in_the_items_order_whatever_finishes_first():
    def slow_first(item: int) -> int:
        time.sleep(0.05 if item == 0 else 0)
        return item * item

    assert list(prefetch(slow_first, range(7), num_threads=3)) == [n * n for n in range(7)]


def test_no_more_items_are_taken_than_twice_the_threads_ahead():
    taken = []

    def items() -> Iterator[int]:
        for number in range(100):
            taken.append(number)
            yield number

    results = prefetch(lambda item: item, items(), num_threads=2)
    assert next(results) == 0
    assert len(taken) == 4
    assert next(results) == 1
    assert len(taken) == 5
    results.close()


def test_it_works_on_several_threads_at_once():
    meeting = threading.Barrier(2, timeout=10)
    assert len(list(prefetch(lambda _: meeting.wait(), range(2), num_threads=2))) == 2


def test_an_error_reaches_the_caller_in_its_turn():
    def fail_at_two(item: int) -> int:
        if item == 2:
            raise ValueError("two")
        return item

    results = prefetch(fail_at_two, range(5), num_threads=2)
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(ValueError, match="two"):
        next(results)


def test_a_source_that_has_nothing_yet_keeps_no_result_waiting():
    let_go = threading.Event()

    def source() -> Iterator[int | NotYet]:
        yield 0
        yield 1
        let_go.set()  # Only now can a result be there.
        while len(taken) < 2:
            yield NotYet(0.0)
        yield NotYet(5.0)
        yield 2

    def wait(item: int) -> int:
        assert let_go.wait(10)
        return item

    taken: list[int | NotYet] = []
    for result in prefetch(wait, source(), num_threads=2):
        taken.append(result)
    assert [item for item in taken if item != NotYet(0.0)] == [0, 1, NotYet(5.0), 2]


def test_items_that_come_while_a_result_is_under_way_are_begun():
    meeting = threading.Barrier(2, timeout=10)

    def source() -> Iterator[int | NotYet]:
        yield 0
        yield NotYet(0.0)
        yield 1

    results = prefetch(lambda item: (item, meeting.wait()), source(), num_threads=2)
    assert [item for item, _ in results] == [0, 1]


@needs_blas
@pytest.mark.parametrize("end", ["last result", "closed", "error"])
def test_libraries_run_on_one_thread_until_the_end(end):
    def use(item: int) -> tuple[int, set[int]]:
        if item == 1 and end == "error":
            raise ValueError
        return library_threads()

    with several_threads() as before:
        results = prefetch(use, range(3), num_threads=2)
        assert next(results) == (1, {1})
        assert library_threads() == (1, {1})
        if end == "last result":
            assert list(results) == [(1, {1})] * 2
        elif end == "closed":
            results.close()
        else:
            with pytest.raises(ValueError):  # noqa: PT011
                next(results)
        assert library_threads() == before


def test_closed_early_it_starts_nothing_more():
    started = []
    both_are_busy = threading.Barrier(3, timeout=10)
    let_go = threading.Event()

    def wait(item: int) -> int:
        started.append(item)
        if item > 0:
            both_are_busy.wait()
            assert let_go.wait(10)
        return item

    results = prefetch(wait, range(4), num_threads=2)
    assert next(results) == 0
    both_are_busy.wait()
    # Closeable waits for the items that are worked on.
    threading.Timer(0.3, let_go.set).start()
    results.close()
    assert sorted(started) == [0, 1, 2]
    assert not any(thread.name.startswith("sfm-ahead") for thread in threading.enumerate())

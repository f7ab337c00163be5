"""Threads that do the same to several items."""

from __future__ import annotations

import threading

import pytest
from helpers.library_threads import blas_threads, library_threads, needs_blas, several_threads

from sfm_front.runtime.worker_pool import WorkerPool


@pytest.mark.parametrize("num_threads", [1, 3])
def test_results_come_in_the_order_of_the_items(num_threads):
    first_waits = threading.Event()

    def negative(item: int) -> int:
        # The first item ends last where there are threads to overtake it.
        if item == 0 and num_threads > 1:
            assert first_waits.wait(10)
        if item == 5:
            first_waits.set()
        return -item

    with WorkerPool(num_threads) as workers:
        assert workers.map(negative, iter(range(6))) == [0, -1, -2, -3, -4, -5]


def test_one_thread_is_the_callers():
    with WorkerPool(1) as workers:
        assert workers.map(lambda _: threading.get_ident(), range(3)) == [threading.get_ident()] * 3


def test_several_threads_work_side_by_side():
    meeting = threading.Barrier(3)
    with WorkerPool(3) as workers:
        # Each waits for the others: one thread alone would never get past the first item.
        assert sorted(workers.map(lambda _: meeting.wait(10), range(3))) == [0, 1, 2]


@needs_blas
def test_matrix_products_stay_on_their_thread_while_the_workers_are_there():
    with several_threads() as before:
        with WorkerPool(2) as workers:
            assert workers.map(lambda _: blas_threads(), range(4)) == [{1}] * 4
        assert library_threads() == before


@needs_blas
def test_the_last_workers_to_be_closed_give_the_cores_back():
    with several_threads() as before:
        first, second = WorkerPool(1), WorkerPool(1)
        first.close()
        assert blas_threads() == {1}
        first.close()
        assert blas_threads() == {1}
        second.close()
        assert library_threads() == before
        second.close()
        assert library_threads() == before


@pytest.mark.parametrize("num_threads", [1, 2])
def test_what_goes_wrong_reaches_the_caller(num_threads):
    def fail(item: int) -> int:
        raise ValueError(f"item {item}")

    with WorkerPool(num_threads) as workers, pytest.raises(ValueError, match="item 7"):
        workers.map(fail, [7])


def test_threads_end_with_the_workers():
    with WorkerPool(2) as workers:
        names = workers.map(lambda _: threading.current_thread().name, range(8))
        assert all(name.startswith("sfm-pairs") for name in names)
    assert not {t.name for t in threading.enumerate()} & set(names)

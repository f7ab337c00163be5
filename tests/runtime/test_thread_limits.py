"""The limits on libraries' threads, with several users."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import cv2
import faiss
import pytest
from helpers.library_threads import blas_threads, library_threads, needs_blas, several_threads
from threadpoolctl import threadpool_limits

from sfm_front.runtime.prefetch import prefetch
from sfm_front.runtime.subprocess_env import module_environment
from sfm_front.runtime.thread_limits import single_threaded_calls
from sfm_front.runtime.worker_pool import WorkerPool

pytestmark = needs_blas
LIMITED = (1, {1})


def test_nested_the_outermost_restores():
    with several_threads() as before:
        with single_threaded_calls(opencv=True):
            assert library_threads() == LIMITED
            with single_threaded_calls(opencv=True):
                assert library_threads() == LIMITED
            assert library_threads() == LIMITED
        assert library_threads() == before


def test_opencv_is_limited_only_if_asked():
    with several_threads() as (opencv, blas):
        with single_threaded_calls(opencv=False):
            assert library_threads() == (opencv, {1})
            with single_threaded_calls(opencv=True):
                assert library_threads() == LIMITED
            assert library_threads() == (opencv, {1})
        assert library_threads() == (opencv, blas)


@pytest.mark.parametrize("closed_first", [0, 1])
def test_two_streams_may_end_in_either_order(closed_first):
    with several_threads() as before:
        streams = [prefetch(abs, range(9), num_threads=2) for _ in range(2)]
        for stream in streams:
            next(stream)
        streams[closed_first].close()
        assert library_threads() == LIMITED
        streams[1 - closed_first].close()
        assert library_threads() == before


@pytest.mark.parametrize("opened_first", ["workers", "stream"])
@pytest.mark.parametrize("closed_first", ["workers", "stream"])
def test_workers_and_a_stream_may_end_in_either_order(opened_first, closed_first):
    with several_threads() as before:
        workers = WorkerPool(2) if opened_first == "workers" else None
        stream = prefetch(abs, range(9), num_threads=2)
        next(stream)
        workers = workers or WorkerPool(2)
        if closed_first == "workers":
            workers.close()
            assert library_threads() == LIMITED
            stream.close()
        else:
            stream.close()
            assert library_threads() == (before[0], {1})
            workers.close()
        assert library_threads() == before


def test_users_on_two_threads_overlap():
    both_are_in, first_is_out = threading.Barrier(2, timeout=10), threading.Event()

    def leave_first() -> None:
        with single_threaded_calls(opencv=True):
            both_are_in.wait()
        first_is_out.set()

    def leave_last() -> tuple[int, set[int]]:
        # Never the first to enter as well, or leaving in reverse order would do.
        with single_threaded_calls(opencv=True):
            both_are_in.wait()
            assert first_is_out.wait(10)
            return library_threads()

    with several_threads() as before, ThreadPoolExecutor(2) as pool:
        first, last = pool.submit(leave_first), pool.submit(leave_last)
        first.result()
        assert last.result() == LIMITED
        assert library_threads() == before


def test_many_users_on_many_threads_leave_nothing_behind():
    def use(number: int) -> tuple[int, set[int]]:
        with single_threaded_calls(opencv=number % 2 == 0):
            return library_threads()

    with several_threads() as before:
        with ThreadPoolExecutor(4) as pool:
            seen = list(pool.map(use, range(60)))
        assert all(blas == {1} for _, blas in seen)
        assert all(opencv == 1 for opencv, _ in seen[::2])
        assert library_threads() == before


@pytest.mark.skipif(
    sys.platform == "win32", reason="Microsoft's OpenMP counts threads for the whole process"
)
def test_openmp_comes_back_on_each_thread():
    """It counts threads for each thread apart: the last user of all cannot restore for all."""
    both_are_in, first_is_out = threading.Barrier(2, timeout=10), threading.Event()

    def use(leaves_first: bool) -> tuple[int, int, int]:
        faiss.omp_set_num_threads(2)
        with single_threaded_calls(opencv=False):
            both_are_in.wait()
            meanwhile = faiss.omp_get_max_threads()
            assert leaves_first or first_is_out.wait(10)
            still = faiss.omp_get_max_threads()
        after = faiss.omp_get_max_threads()
        first_is_out.set()
        return meanwhile, still, after

    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(use, [True, False])) == [(1, 1, 2)] * 2


def test_what_was_loaded_or_set_meanwhile_is_limited_again():
    with several_threads() as before:
        with single_threaded_calls(opencv=True):
            # As a library does that has just been loaded.
            threadpool_limits(2, "blas")
            cv2.setNumThreads(3)
            with single_threaded_calls(opencv=True):
                assert library_threads() == LIMITED
        assert library_threads() == before


def test_a_library_loaded_meanwhile_gets_its_own_number_back():
    """In another process: here all libraries are loaded."""
    code = """
import numpy
from threadpoolctl import threadpool_info
from sfm_front.runtime.thread_limits import single_threaded_calls

def blas():
    return {l["filepath"]: l["num_threads"] for l in threadpool_info() if l["user_api"] == "blas"}

first, second = single_threaded_calls(opencv=True), single_threaded_calls(opencv=True)
alone = blas()
with first:
    import faiss
    fresh = blas()
    second.__enter__()
    assert set(blas().values()) == {1}, blas()
assert set(blas().values()) == {1}, blas()
second.__exit__(None, None, None)
assert blas() == fresh | alone, (blas(), fresh, alone)
"""
    environment = module_environment() | {"OMP_NUM_THREADS": "2"}
    subprocess.run([sys.executable, "-c", code], check=True, env=environment)


def test_workers_that_nobody_closed_give_the_cores_back():
    with several_threads() as before:
        workers = WorkerPool(1)
        assert blas_threads() == {1}
        del workers
        gc.collect()
        assert library_threads() == before

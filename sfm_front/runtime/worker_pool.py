"""A few threads that map a function over items."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import ClassVar, TypeVar

from threadpoolctl import threadpool_limits

from sfm_front.runtime.closeable import Closeable

Item = TypeVar("Item")
Result = TypeVar("Result")


class WorkerPool(Closeable):
    """Maps a function over items on ``num_threads`` threads; results are in the items' order.

    While a pool is open, matrix products and two-view estimation run on the calling thread alone:
    split over all cores, they would make the threads wait for each other. The limit holds for the
    whole process until the last pool is closed.
    """

    _lock: ClassVar[Lock] = Lock()
    _num_open: ClassVar[int] = 0
    _limits: ClassVar[list[threadpool_limits]] = []

    def __init__(self, num_threads: int) -> None:
        self.num_threads = num_threads
        self._pool = (
            ThreadPoolExecutor(num_threads, "sfm-pairs", threadpool_limits, (1, "openmp"))
            if num_threads > 1
            else None
        )
        self._closed = False
        with self._lock:
            # Once per pool: more libraries may have been loaded since the last one.
            self._limits.append(threadpool_limits(1))
            WorkerPool._num_open += 1

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        if self._pool is None:
            return [function(item) for item in items]
        return list(self._pool.map(function, items))

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        with self._lock:
            if self._closed:
                return
            self._closed = True
            WorkerPool._num_open -= 1
            while WorkerPool._num_open == 0 and self._limits:
                self._limits.pop().restore_original_limits()

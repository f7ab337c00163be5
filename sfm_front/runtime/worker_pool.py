"""A few threads that map a function over items."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from typing import TypeVar

from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.thread_limits import limit_this_thread, single_threaded_calls

Item = TypeVar("Item")
Result = TypeVar("Result")


class WorkerPool(Closeable):
    """Maps a function over items on ``num_threads`` threads; results are in the items' order.

    While it is open, matrix products run on the thread that asks for them. OpenCV does not: photos
    that are not prefetched are described on all cores, and its two-view estimates use one anyway.
    """

    def __init__(self, num_threads: int) -> None:
        self.num_threads = num_threads
        self._pool = (
            ThreadPoolExecutor(num_threads, "sfm-pairs", limit_this_thread)
            if num_threads > 1
            else None
        )
        self._limits = ExitStack()
        self._limits.enter_context(single_threaded_calls(opencv=False))

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        if self._pool is None:
            return [function(item) for item in items]
        return list(self._pool.map(function, items))

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        self._limits.close()

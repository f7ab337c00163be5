"""A few threads that do the same thing to several items."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from threadpoolctl import threadpool_limits

from sfm_front.closing import Closing

Item = TypeVar("Item")
Result = TypeVar("Result")


class Workers(Closing):
    """Maps a function over items on ``num_threads`` threads; results come in the items' order.

    While it is open, matrix products and two-view estimates run on the thread that asks for them:
    split over all cores, they would have the threads wait for each other.
    """

    def __init__(self, num_threads: int) -> None:
        self.num_threads = num_threads
        self._pool = (
            ThreadPoolExecutor(num_threads, "sfm-pairs", threadpool_limits, (1, "openmp"))
            if num_threads > 1
            else None
        )
        self._limits = threadpool_limits(1)

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        if self._pool is None:
            return [function(item) for item in items]
        return list(self._pool.map(function, items))

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
        self._limits.restore_original_limits()

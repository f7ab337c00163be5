"""A few threads that do the same thing to several items."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import TypeVar

import faiss

Item = TypeVar("Item")
Result = TypeVar("Result")


class Workers:
    """Maps a function over items on ``num_threads`` threads; results come in the items' order.

    Each thread has faiss to itself: one that splits every call over all cores would have
    the threads wait for each other, which costs more than it gains.
    """

    def __init__(self, num_threads: int) -> None:
        self._pool = (
            ThreadPoolExecutor(num_threads, "sfm-pairs", initializer=use_one_thread)
            if num_threads > 1
            else None
        )

    def map(self, function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
        if self._pool is None:
            return [function(item) for item in items]
        return list(self._pool.map(function, items))

    def __enter__(self) -> Workers:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)


def use_one_thread() -> None:
    """Keep faiss calls of the calling thread on that thread."""
    faiss.omp_set_num_threads(1)

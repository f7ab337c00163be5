"""Map a function over items in threads, at most a bounded number ahead of the consumer."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from itertools import islice
from typing import TypeVar

import cv2
from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")


def prefetch(
    function: Callable[[Item], Result], items: Iterable[Item], *, num_threads: int
) -> Generator[Result, None, None]:
    """Results in the items' order, computed at most ``2 * num_threads`` ahead.

    Until the generator ends or is closed, matrix products and OpenCV run on the calling thread
    alone: split over all cores, they would make the threads wait for each other.
    """
    source = iter(items)
    ahead: deque[Future[Result]] = deque()
    with (
        _undivided_calls(),
        ThreadPoolExecutor(num_threads, "sfm-ahead", threadpool_limits, (1, "openmp")) as pool,
    ):
        try:
            while True:
                for item in islice(source, 2 * num_threads - len(ahead)):
                    ahead.append(pool.submit(function, item))
                if not ahead:
                    return
                yield ahead.popleft().result()
        finally:
            for future in ahead:
                future.cancel()


@contextmanager
def _undivided_calls() -> Iterator[None]:
    opencv_threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(opencv_threads)

"""Map a function over items in threads, at most a bounded number ahead of the consumer."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar

from sfm_front.runtime.thread_limits import limit_this_thread, single_threaded_calls

Item = TypeVar("Item")
Result = TypeVar("Result")


def prefetch(
    function: Callable[[Item], Result], items: Iterable[Item], *, num_threads: int
) -> Generator[Result, None, None]:
    """Results in the items' order, computed at most ``2 * num_threads`` ahead.

    Until the last one, or until it is closed, matrix products and OpenCV run on the thread that
    asks for them.
    """
    source = iter(items)
    ahead: deque[Future[Result]] = deque()
    with (
        single_threaded_calls(opencv=True),
        ThreadPoolExecutor(num_threads, "sfm-ahead", limit_this_thread) as pool,
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

"""Map a function over items in threads, at most a bounded number ahead of the consumer."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import TypeVar, overload

from sfm_front.runtime.thread_limits import limit_this_thread, single_threaded_calls
from sfm_front.types import NotYet

Item = TypeVar("Item")
Result = TypeVar("Result")


@overload
def prefetch(
    function: Callable[[Item], Result], items: Iterable[Item], *, num_threads: int
) -> Generator[Result, None, None]: ...
@overload
def prefetch(
    function: Callable[[Item], Result], items: Iterable[Item | NotYet], *, num_threads: int
) -> Generator[Result | NotYet, None, None]: ...
def prefetch(
    function: Callable[[Item], Result], items: Iterable[Item | NotYet], *, num_threads: int
) -> Generator[Result | NotYet, None, None]:
    """Results in the items' order, computed at most ``2 * num_threads`` ahead.

    Items are asked for in the thread that asks for results. A source that has none for now gives
    ``NotYet`` rather than keep that thread waiting: each result is handed on as soon as it is
    there, and ``NotYet`` itself once no result is under way. A source should wait a little before
    it gives ``NotYet``, since it is asked again at once.

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
                not_yet = None
                for item in islice(source, 2 * num_threads - len(ahead)):
                    if isinstance(item, NotYet):
                        not_yet = item
                        break
                    ahead.append(pool.submit(function, item))
                if ahead:
                    if not_yet is None or ahead[0].done():
                        yield ahead.popleft().result()
                elif not_yet is not None:
                    yield not_yet
                else:
                    return
        finally:
            for future in ahead:
                future.cancel()

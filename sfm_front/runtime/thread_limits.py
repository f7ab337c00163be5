"""How many threads libraries use: a setting of the process, which several users here share."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any

import cv2
from threadpoolctl import OpenBLASController, ThreadpoolController, threadpool_limits


@contextmanager
def single_threaded_calls(*, opencv: bool) -> Iterator[None]:
    """Matrix products, and OpenCV if so asked, run on the thread that asks for them.

    Split over all cores, they would have our own threads wait for each other. Users may overlap in
    any order and on any threads: each limits again what was loaded since, and the last to leave
    restores what was there before the first. OpenMP counts threads for each thread apart: it is
    limited on the thread that enters, and restored where the last of that thread leaves there.
    """
    with ExitStack() as held:
        held.enter_context(_libraries.held())
        held.enter_context(_of_this_thread.libraries.held())
        if opencv:
            held.enter_context(_opencv.held())
        yield


def limit_this_thread() -> None:
    """OpenMP runs on this thread alone, for as long as the thread lives."""
    threadpool_limits(1, "openmp")


class _Limit:
    """Set while it has users; what was there before comes back with the last of them."""

    def __init__(
        self, set_it: Callable[[], Callable[[], object] | None], *, of_thread: int | None = None
    ) -> None:
        """``set_it`` gives what takes it back, or None if it was set already.

        ``of_thread``: the only thread that can take it back; None for any.
        """
        self._set_it = set_it
        self._of_thread = of_thread
        self._num_users = 0
        self._restore = ExitStack()
        # Reentrant: the garbage collector may end a forgotten user while another one enters.
        self._lock = threading.RLock()

    @contextmanager
    def held(self) -> Iterator[None]:
        with self._lock:
            self._num_users += 1
            restore = self._set_it()
            if restore is not None:
                self._restore.callback(restore)
        try:
            yield
        finally:
            with self._lock:
                self._num_users -= 1
                if not self._num_users and self._of_thread in (None, threading.get_ident()):
                    self._restore.close()


def _limit_libraries(*, counting_for: str) -> Callable[[], object] | None:
    """Of those that count threads for the whole process, or for each thread apart: OpenMP does,
    and so does a BLAS built on it."""
    libraries = ThreadpoolController()
    divided = [
        library["filepath"]
        for library in libraries.info()
        if library["num_threads"] != 1
        and counting_for == ("thread" if "openmp" in _layers(library) else "process")
    ]
    if not divided:
        return None
    with _in_control():
        limits = libraries.select(filepath=divided).limit(limits=1)

    def restore() -> None:
        with _in_control():
            limits.restore_original_limits()

    return restore


def _layers(library: Mapping[str, Any]) -> tuple[str | None, str | None]:
    return library["user_api"], library.get("threading_layer")


@contextmanager
def _in_control() -> Iterator[None]:
    """threadpoolctl lets one thread alone set OpenBLAS and ignores all others without a word: no
    thread may keep that right, since another one may be the last to leave."""
    OpenBLASController.clear_controlling_thread(force=True)
    yield
    OpenBLASController.clear_controlling_thread(force=True)


def _limit_opencv() -> Callable[[], object] | None:
    before = cv2.getNumThreads()
    if before == 1:
        return None
    # 0 is no threads at all. What 1 does depends on OpenCV's parallel framework.
    cv2.setNumThreads(0)
    return lambda: cv2.setNumThreads(before)


class _OfThisThread(threading.local):
    def __init__(self) -> None:
        set_it = partial(_limit_libraries, counting_for="thread")
        self.libraries = _Limit(set_it, of_thread=threading.get_ident())


_libraries = _Limit(partial(_limit_libraries, counting_for="process"))
_opencv = _Limit(_limit_opencv)
_of_this_thread = _OfThisThread()

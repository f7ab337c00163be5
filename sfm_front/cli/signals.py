"""Ctrl-C, SIGTERM and SIGHUP: the first may ask a run to stop, one too many ends the process."""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from threading import Thread

INTERRUPTED = 130
"""Exit status of a run that left at once, as a shell has it for Ctrl-C."""

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")  # Windows has no SIGHUP.
_STANDARD_ERROR = 2


@contextmanager
def leaving_at_signal(count: int, first_told: str = "") -> Iterator[Callable[[], bool]]:
    """Until its end, the ``count``-th of these signals ends the process, with status 130.

    Yields a function that tells whether one has come. ``first_told`` is what the user reads on
    standard error when one has come that does not end the process. Signals that are ignored, as
    SIGHUP under ``nohup``, stay so. For the main thread alone, as handlers of signals are.
    """
    numbers = [getattr(signal, name) for name in _NAMES if hasattr(signal, name)]
    caught = [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]
    came: list[int] = []
    # A handler in Python has to wait for a main thread that is in a long call or in a hung mount;
    # a thread woken through a socket has not.
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    watcher = Thread(
        target=_watch, args=(receiver, caught, count, first_told), name="sfm-signals", daemon=True
    )
    watcher.start()
    woken_before = signal.set_wakeup_fd(sender.fileno(), warn_on_full_buffer=False)
    before = {
        number: signal.signal(number, lambda number, _frame: came.append(number))
        for number in caught
    }
    try:
        yield lambda: bool(came)
    finally:
        signal.set_wakeup_fd(woken_before)
        for number, handler in before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        sender.close()
        watcher.join()
        receiver.close()


def _watch(wakeups: socket.socket, caught: Collection[int], count: int, first_told: str) -> None:
    left = count
    while wakeup := wakeups.recv(1):
        if wakeup[0] not in caught:
            continue
        left -= 1
        if left <= 0:
            _tell("interrupted")
            # Neither the main thread nor those that read photos may be waited for.
            os._exit(INTERRUPTED)
        _tell(first_told)


def _tell(line: str) -> None:
    """Past Python's streams: a lock of theirs may be held. The line before it may be unfinished."""
    with suppress(OSError):
        os.write(_STANDARD_ERROR, f"\n{line}\n".encode())

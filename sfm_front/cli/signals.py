"""Ctrl-C, SIGTERM and SIGHUP: the first may ask a run to stop, one too many ends the process."""

from __future__ import annotations

import ctypes
import os
import platform
import signal
import socket
import sys
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from threading import Thread

_BY_SIGNAL = 128  # What a shell adds to the number of the signal that ended a process.
INTERRUPTED = _BY_SIGNAL + signal.SIGINT
"""Exit status of a run that Ctrl-C ended at once: 130."""

CLOSING = "closing the live page"
"""What the user reads where Ctrl-C is how it ends."""

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")  # Windows has no SIGHUP.
_STANDARD_ERROR = 2
_SA_RESETHAND = 0x80000000


@contextmanager
def leaving_at_signal(count: int, first_told: str = "") -> Iterator[Callable[[], bool]]:
    """Until its end, the ``count``-th of these signals ends the process.

    The status is 128 and the signal's number, as of what a signal ends. On Linux the second one of
    a kind ends it by the signal itself, even in a call of a library that lets no Python run.
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
    for number in caught:
        _default_after_first(number)
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
            os._exit(_BY_SIGNAL + wakeup[0])
        _tell(first_told)


class _SigAction(ctypes.Structure):
    """``struct sigaction`` of glibc and musl."""

    _fields_ = (
        ("handler", ctypes.c_void_p),
        ("mask", ctypes.c_ubyte * 128),
        ("flags", ctypes.c_uint),
        ("restorer", ctypes.c_void_p),
    )


def _default_after_first(number: int) -> None:
    """Have the system itself end the process at the second signal of this kind.

    COLMAP's global refinement, which can take minutes, holds the interpreter's lock: neither a
    handler in Python nor a thread could act before it returns.
    """
    if sys.platform != "linux" or platform.machine() not in ("x86_64", "aarch64"):
        return  # The structure may be another one there.
    libc = ctypes.CDLL(None)
    action = _SigAction()
    if libc.sigaction(number, None, ctypes.byref(action)) == 0:
        action.flags |= _SA_RESETHAND
        libc.sigaction(number, ctypes.byref(action), None)


def _tell(line: str) -> None:
    """Past Python's streams: a lock of theirs may be held. The line before it may be unfinished."""
    with suppress(OSError):
        os.write(_STANDARD_ERROR, f"\n{line}\n".encode())

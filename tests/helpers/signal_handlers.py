"""Signals as a terminal's program has them, whatever runs the tests."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def default_handlers() -> Iterator[None]:
    """Until its end, nothing is ignored: nohup ignores SIGHUP, and a shell's & SIGINT."""
    defaults = {signal.SIGINT: signal.default_int_handler}
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {n: signal.signal(n, defaults.get(n, signal.SIG_DFL)) for n in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

"""Seconds by stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stopwatch:
    """Adds up wall seconds per stage."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        started = time.perf_counter()
        try:
            yield
        finally:
            elapsed = time.perf_counter() - started
            self.seconds[name] = self.seconds.get(name, 0.0) + elapsed

    def move(self, whole: str, part: str, seconds: float) -> None:
        """Move ``seconds`` that were spent inside the stage ``whole`` to the stage ``part``."""
        self.seconds[whole] -= seconds
        self.seconds[part] = self.seconds.get(part, 0.0) + seconds

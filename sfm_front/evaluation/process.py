"""Run a command and measure it from outside: wall seconds and peak memory."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from time import perf_counter

from sfm_front.runtime.subprocess_env import module_environment

_POLL_SECONDS = 0.05


@dataclass(frozen=True, slots=True)
class Measured:
    """``peak_memory_bytes`` is the peak resident set of the process without its children; None on
    systems without /proc. ``last_line`` is the last line it printed."""

    return_code: int
    wall_seconds: float
    peak_memory_bytes: int | None
    last_line: str


def measure(command: Sequence[str], log: Path) -> Measured:
    """Run ``command`` to its end; standard output and error go to the file ``log``."""
    peak = _Peak()
    with log.open("wb") as sink:
        started = perf_counter()
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=sink,
            stderr=subprocess.STDOUT,
            # Unbuffered, so that both streams' lines are in the order they were printed.
            env=module_environment() | {"PYTHONUNBUFFERED": "1"},
        )
        ended = Event()
        watcher = Thread(target=peak.watch, args=(process.pid, ended), daemon=True)
        watcher.start()
        try:
            return_code = process.wait()
        except BaseException:
            process.kill()
            process.wait()
            raise
        finally:
            ended.set()
        wall_seconds = perf_counter() - started
        watcher.join()
    lines = log.read_text(errors="replace").strip().splitlines()
    return Measured(return_code, wall_seconds, peak.bytes, lines[-1].strip() if lines else "")


def resident_bytes() -> int | None:
    """Resident memory of this process now; None on systems without /proc."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE")


class _Peak:
    """The kernel's high-water mark, polled because it disappears with the process.

    ``getrusage`` does not help: a child starts with the peak of the process that forked it.
    """

    def __init__(self) -> None:
        self.bytes: int | None = None

    def watch(self, pid: int, ended: Event) -> None:
        status = Path(f"/proc/{pid}/status")
        while not ended.is_set():
            try:
                text = status.read_text()
            except OSError:
                return
            for line in text.splitlines():
                if line.startswith("VmHWM:"):
                    self.bytes = int(line.split()[1]) * 1024
            ended.wait(_POLL_SECONDS)

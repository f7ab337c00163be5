"""The worker's side of a task: unpack, do it with what a session is made of, count, pack."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Any

from sfm_front.cluster.describing import describe
from sfm_front.cluster.growing import grow, join
from sfm_front.cluster.identity import worker_name
from sfm_front.cluster.matching import match
from sfm_front.cluster.work import (
    DESCRIBE,
    GROW,
    JOIN,
    MATCH,
    Answer,
    RunSettings,
    pack,
    unpack,
)
from sfm_front.cluster.workbench import Counts, Workbench
from sfm_front.runtime.thread_limits import limit_this_thread, single_threaded_calls

_DO: Mapping[str, Callable[[Workbench, Any, Counts], Any]] = {
    DESCRIBE: describe,
    MATCH: match,
    GROW: grow,
    JOIN: join,
}


def run(kind: str, parcel: bytes) -> Answer:
    """On the thread that Dask calls."""
    settings: RunSettings
    settings, work = unpack(parcel)
    began, cpu = time.perf_counter(), time.process_time()
    limit_this_thread()
    counts = Counts(bytes_in=len(parcel))
    with single_threaded_calls(opencv=True):
        result = pack(_DO[kind](_workbench(settings), work, counts))
    return Answer(
        result=result,
        worker=worker_name(),
        seconds=time.perf_counter() - began,
        cpu_seconds=time.process_time() - cpu,
        items=counts.items,
        reused=counts.reused,
        bytes_in=counts.bytes_in,
        bytes_out=counts.bytes_out + len(result),
    )


def _workbench(settings: RunSettings) -> Workbench:
    """What the tasks of one run share. That of an earlier run goes once no task holds it: the last
    one of a coordinator that died may still run."""
    global _current
    with _lock:
        if _current is None or _current.settings.run_id != settings.run_id:
            _current = Workbench(settings)
        return _current


_lock = Lock()
_current: Workbench | None = None

"""Loaded by each worker process that ``--cluster local:N`` starts, before anything else."""

from __future__ import annotations

import signal


def dask_setup(_worker: object) -> None:
    """A Ctrl-C in a terminal reaches all processes started there: it is for the coordinator, whose
    end ends its workers."""
    for name in ("SIGINT", "SIGHUP"):  # Windows has no SIGHUP.
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)

"""What Dask calls on a worker. Light: a scheduler reads it too."""

from __future__ import annotations

from typing import Any


def run_task(kind: str, parcel: bytes) -> Any:
    """Do a task of ``work.py``; returns an ``Answer``."""
    from sfm_front.cluster.worker import run

    return run(kind, parcel)

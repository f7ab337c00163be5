"""What the workers of a cluster did in a session, and ``cluster`` in ``report.json``.

``cluster/README.md`` says what each key means.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskKindOutcome:
    """Tasks of one kind that were done, and what they took in all.

    ``items``: photos described or matched, or in groups; ``reused`` of them were found done.
    ``cpu_seconds``: of the worker meanwhile, which others may have kept waiting. ``bytes_in`` and
    ``bytes_out``: what they were given and gave, in messages and files.
    """

    kind: str
    count: int
    items: int
    reused: int
    seconds: float
    cpu_seconds: float
    longest_seconds: float
    bytes_in: int
    bytes_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerOutcome:
    """What one worker did. ``waiting_seconds``: without a task while some were under way."""

    name: str
    tasks: int
    busy_seconds: float
    waiting_seconds: float
    bytes_in: int
    bytes_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupOutcome:
    """A group of ``photos``, of which ``registered`` found a place in its largest model; or two of
    them, whose models were joined.

    ``seconds`` is 0 if its models were there from an earlier run.
    """

    photos: int
    is_join: bool
    registered: int
    models: int
    seconds: float
    bytes_in: int
    bytes_out: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FailedTask:
    """A task that was given up: of what kind, why, and the photos it held."""

    kind: str
    reason: str
    photos: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterOutcome:
    """``serial_seconds``: of the coordinator, by stage, before the session's own end.

    ``distributed_seconds``: wall time from the first task to the last answer. ``lost``: tasks that
    were begun again, since they failed or their worker died.
    """

    scheduler: str
    dashboard: str | None
    shared_storage: bool
    group_size: int
    distributed_seconds: float
    serial_seconds: Mapping[str, float]
    tasks: tuple[TaskKindOutcome, ...]
    workers: tuple[WorkerOutcome, ...]
    groups: tuple[GroupOutcome, ...]
    lost: int
    failed: tuple[FailedTask, ...]


def cluster_row(outcome: ClusterOutcome | None) -> dict[str, Any] | None:
    """Ready for JSON."""
    return None if outcome is None else _rounded(asdict(outcome))


def cluster_of_row(row: Mapping[str, Any] | None) -> ClusterOutcome | None:
    """What ``cluster_row`` gave."""
    if row is None:
        return None
    failed = (FailedTask(**{**one, "photos": tuple(one["photos"])}) for one in row["failed"])
    return ClusterOutcome(
        **{
            **row,
            "tasks": tuple(TaskKindOutcome(**one) for one in row["tasks"]),
            "workers": tuple(WorkerOutcome(**one) for one in row["workers"]),
            "groups": tuple(GroupOutcome(**one) for one in row["groups"]),
            "failed": tuple(failed),
        }
    )


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, 3)
    if isinstance(value, dict):
        return {key: _rounded(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(one) for one in value]
    return value

"""Counts what the workers do, and what the coordinator does meanwhile."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from sfm_front.cluster.work import Answer
from sfm_front.reports.cluster_outcome import (
    ClusterOutcome,
    FailedTask,
    GroupOutcome,
    TaskKindOutcome,
    WorkerOutcome,
)
from sfm_front.runtime.stopwatch import Stopwatch


@dataclass(slots=True)
class _Sum:
    count: int = 0
    items: int = 0
    reused: int = 0
    seconds: float = 0.0
    cpu: float = 0.0
    longest: float = 0.0
    bytes_in: int = 0
    bytes_out: int = 0

    def add(self, answer: Answer) -> None:
        self.count += 1
        self.items += answer.items
        self.reused += answer.reused
        self.seconds += answer.seconds
        self.cpu += answer.cpu_seconds
        self.longest = max(self.longest, answer.seconds)
        self.bytes_in += answer.bytes_in
        self.bytes_out += answer.bytes_out


class Figures:
    """Of one run."""

    def __init__(self) -> None:
        self._kinds: defaultdict[str, _Sum] = defaultdict(_Sum)
        self._workers: defaultdict[str, _Sum] = defaultdict(_Sum)
        self._first_seen: dict[str, float] = {}
        self._clock = Stopwatch()
        self._under_way = 0
        self._since = 0.0
        self.distributed_s = 0.0
        self.lost = 0
        self.groups: list[GroupOutcome] = []
        self.failed: list[FailedTask] = []

    @contextmanager
    def serial(self, stage: str) -> Iterator[None]:
        """Work of the coordinator."""
        with self._clock.stage(stage):
            yield

    def begin(self) -> None:
        """A task is handed out."""
        if self._under_way == 0:
            self._since = time.perf_counter()
        self._under_way += 1

    def end(self) -> None:
        """It has ended in any way."""
        self._under_way -= 1
        if self._under_way == 0:
            self.distributed_s += time.perf_counter() - self._since

    def add(self, kind: str, answer: Answer) -> None:
        """What a worker did."""
        self._kinds[kind].add(answer)
        self._workers[answer.worker].add(answer)

    def mean_seconds(self, kind: str) -> float | None:
        """Of a task; None before the first has ended."""
        found = self._kinds.get(kind)
        return found.seconds / found.count if found else None

    @property
    def num_workers(self) -> int:
        """Those that have done something."""
        return len(self._workers)

    def outcome(
        self, *, scheduler: str, dashboard: str | None, shared_storage: bool, group_size: int
    ) -> ClusterOutcome:
        """For the report."""
        return ClusterOutcome(
            scheduler=scheduler,
            dashboard=dashboard,
            shared_storage=shared_storage,
            group_size=group_size,
            distributed_seconds=self.distributed_s,
            serial_seconds=dict(self._clock.seconds),
            tasks=tuple(
                TaskKindOutcome(
                    kind=kind,
                    count=found.count,
                    items=found.items,
                    reused=found.reused,
                    seconds=found.seconds,
                    cpu_seconds=found.cpu,
                    longest_seconds=found.longest,
                    bytes_in=found.bytes_in,
                    bytes_out=found.bytes_out,
                )
                for kind, found in self._kinds.items()
            ),
            workers=tuple(
                WorkerOutcome(
                    name=name,
                    tasks=found.count,
                    busy_seconds=found.seconds,
                    waiting_seconds=max(0.0, self.distributed_s - found.seconds),
                    bytes_in=found.bytes_in,
                    bytes_out=found.bytes_out,
                )
                for name, found in sorted(self._workers.items())
            ),
            groups=tuple(self.groups),
            lost=self.lost,
            failed=tuple(self.failed),
        )

"""What a photo costs workers and coordinator, from the reports of runs on a cluster."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sfm_front.cluster.work import DESCRIBE, GROW, JOIN, MATCH
from sfm_front.errors import InputError
from sfm_front.evaluation.power_law import PowerLaw
from sfm_front.reports.cluster_outcome import ClusterOutcome, TaskKindOutcome, cluster_of_row

# Stages of the coordinator while workers work, as ``cluster/`` names them.
RETRIEVE, STORE, CUT, GROUP, TAKE = "retrieve", "store", "cut", "group", "take models"


@dataclass(frozen=True, slots=True)
class ClusterRun:
    """A run that was measured. ``end_seconds``: of the coordinator, after the last task."""

    num_photos: int
    num_workers: int
    wall_seconds: float
    end_seconds: float
    outcome: ClusterOutcome

    @classmethod
    def read(cls, report: Path) -> ClusterRun:
        """From a ``report.json``. Raises InputError if it is none of a whole run on a cluster."""
        try:
            content: Mapping[str, Any] = json.loads(report.read_text(encoding="utf-8"))
            outcome = cluster_of_row(content.get("cluster"))
            totals, end = content["totals"], content["end"]["seconds"]
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{report}: not a report.json of sfm_front.") from error
        if outcome is None:
            raise InputError(f"{report}: of a run without --cluster. Run it with one.")
        if outcome.lost or outcome.failed or any(task.reused for task in outcome.tasks):
            raise InputError(
                f"{report}: of a run that was gone on with, or lost tasks. Run it undisturbed."
            )
        return cls(
            num_photos=int(totals["photos"]),
            num_workers=len(outcome.workers),
            wall_seconds=float(totals["wall_seconds"]),
            end_seconds=float(sum(end.values())),
            outcome=outcome,
        )

    @property
    def start_seconds(self) -> float:
        """Before the first task."""
        serial = self.end_seconds + self.outcome.serial_seconds.get(CUT, 0.0)
        return max(0.0, self.wall_seconds - self.outcome.distributed_seconds - serial)

    def task(self, kind: str) -> TaskKindOutcome | None:
        """What the tasks of a kind took; None if there were none."""
        return next((task for task in self.outcome.tasks if task.kind == kind), None)


@dataclass(frozen=True, slots=True)
class TaskCost:
    """Of one photo in a task: processor seconds of a worker, and bytes in and out together."""

    seconds: float
    num_bytes: float


@dataclass(frozen=True, slots=True)
class Costs:
    """``describe``, ``match``, ``grow`` and ``join`` per photo of a task. The others in seconds of
    the coordinator for all photos; ``end``: after all tasks.

    ``group`` and ``take`` count photos of groups, which overlap by ``overlap`` of their size.
    """

    describe: TaskCost
    match: TaskCost
    grow: TaskCost
    join: TaskCost
    retrieve: PowerLaw
    store: PowerLaw
    cut: PowerLaw
    group: PowerLaw
    take: PowerLaw
    end: PowerLaw
    start_seconds: float
    group_size: int
    overlap: float

    @classmethod
    def of(cls, runs: Sequence[ClusterRun], ends: Mapping[int, float] | None = None) -> Costs:
        """Of runs with groups of one size. Tasks cost the mean of all; the coordinator's work is
        fitted as a power of the number of photos, in proportion where all had as many.

        ``ends``: photos → seconds of the end of other sessions, larger ones say, which are fitted
        too.

        Raises InputError without runs, for groups of several sizes, and where no groups were grown
        or joined by workers.
        """
        if not runs:
            raise InputError("costs need the report of a run at least")
        sizes = {run.outcome.group_size for run in runs}
        if len(sizes) > 1:
            raise InputError(
                f"these runs had groups of {', '.join(map(str, sorted(sizes)))} photos: what a "
                "photo costs depends on it. Give runs with the same --group-size."
            )

        def stage(name: str) -> PowerLaw:
            seconds = [run.outcome.serial_seconds.get(name, 0.0) for run in runs]
            return _fitted([(run.num_photos, s) for run, s in zip(runs, seconds, strict=True)])

        measured_ends = [(run.num_photos, run.end_seconds) for run in runs]

        in_groups = sum(
            group.photos for run in runs for group in run.outcome.groups if not group.is_join
        )
        return cls(
            describe=_task_cost(runs, DESCRIBE),
            match=_task_cost(runs, MATCH),
            grow=_task_cost(runs, GROW),
            join=_task_cost(runs, JOIN),
            retrieve=stage(RETRIEVE),
            store=stage(STORE),
            cut=stage(CUT),
            group=stage(GROUP),
            take=stage(TAKE),
            end=_fitted([*measured_ends, *(ends or {}).items()]),
            start_seconds=float(np.mean([run.start_seconds for run in runs])),
            group_size=sizes.pop(),
            overlap=max(0.0, in_groups / sum(run.num_photos for run in runs) - 1),
        )


def _task_cost(runs: Sequence[ClusterRun], kind: str) -> TaskCost:
    tasks = [task for run in runs if (task := run.task(kind)) is not None]
    items = sum(task.items for task in tasks)
    if items == 0:
        raise InputError(
            f"no task of the kind {kind!r} in these reports. Give runs with smaller groups, of "
            "which more than two are joined."
        )
    return TaskCost(
        sum(task.cpu_seconds for task in tasks) / items,
        sum(task.bytes_in + task.bytes_out for task in tasks) / items,
    )


def _fitted(measured: Sequence[tuple[int, float]]) -> PowerLaw:
    """Photos and seconds of each run."""
    known = [(photos, seconds) for photos, seconds in measured if seconds > 0]
    return PowerLaw.through(*zip(*known, strict=True)) if known else PowerLaw(0.0)

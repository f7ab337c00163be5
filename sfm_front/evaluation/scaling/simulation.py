"""A run on a cluster, simulated: the coordinator's loops, its tasks and what they wait for."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from sfm_front.cluster.groups import num_parts
from sfm_front.cluster.join_plan import LEFT
from sfm_front.cluster.photo_stage import batch_size, most_ahead
from sfm_front.cluster.task_queue import most_under_way
from sfm_front.errors import ConfigError, DependencyError
from sfm_front.evaluation.scaling.costs import Costs, TaskCost

if TYPE_CHECKING:
    import simpy

# Seconds for which a process keeps a core that others want too.
_SLICE_S = 0.05

Steps = Generator["simpy.Event", Any, None]


@dataclass(frozen=True, kw_only=True)
class ClusterShape:
    """What is simulated.

    ``num_cores``: that all workers and the coordinator share, as with ``--cluster local:N``; None
    if each has its own. ``bytes_per_second``: of the one way that all photos, features and models
    take, to shared storage or the coordinator.
    """

    num_workers: int
    num_cores: int | None = None
    bytes_per_second: float = 125e6
    # Photos of a task, as ``ClusterOptions`` has it.
    batch_size: int = 8

    def __post_init__(self) -> None:
        if self.num_workers < 1:
            raise ConfigError(f"num_workers must be at least 1, got {self.num_workers}")
        if self.num_cores is not None and self.num_cores < 1:
            raise ConfigError(f"num_cores must be at least 1, got {self.num_cores}")
        if not self.bytes_per_second > 0:
            raise ConfigError(f"bytes_per_second must be above 0, got {self.bytes_per_second}")


@dataclass(slots=True)
class Prediction:
    """Seconds: of the whole; ``photos_s`` of it until all photos are matched, ``groups_s`` from
    there until all groups are grown, ``end_s`` after. ``busy``: share of that time before the end
    in which workers, on average, worked or waited for bytes."""

    wall_s: float = 0.0
    photos_s: float = 0.0
    groups_s: float = 0.0
    end_s: float = 0.0
    busy: float = 0.0


def simulate(costs: Costs, num_photos: int, shape: ClusterShape) -> Prediction:
    """How long a run with so many photos takes, all of which are used and linked.

    Raises DependencyError without simpy.
    """
    if num_photos < 1:
        raise ConfigError(f"a run has at least one photo, got {num_photos}")
    try:
        import simpy
    except ImportError as error:
        raise DependencyError(f"{error}: a simulation needs it; pip install simpy") from error
    run = _Run(simpy.Environment(), costs, num_photos, shape)
    run.env.run(run.env.process(run.coordinator()))
    return run.prediction


@dataclass(slots=True, eq=False)
class _Batch:
    """Photos of one task, and whether it has ended. A group's may be joined to another's: that task
    waits for both its parts."""

    num_photos: float
    kind: TaskCost
    is_done: bool = False
    union: _Batch | None = None
    num_parts_left: int = 2


@dataclass(eq=False)
class _Run:
    env: simpy.Environment
    costs: Costs
    num_photos: int
    shape: ClusterShape
    prediction: Prediction = field(default_factory=Prediction)

    def __post_init__(self) -> None:
        import simpy

        shape = self.shape
        self._workers = simpy.Resource(self.env, shape.num_workers)
        self._cores = None if shape.num_cores is None else simpy.Resource(self.env, shape.num_cores)
        self._way = simpy.Resource(self.env, 1)
        self._ended = simpy.Store(self.env)
        self._under_way = 0
        self._busy_s = 0.0

    def coordinator(self) -> Steps:
        """From the first photo to the models."""
        yield self.env.timeout(self.costs.start_seconds)
        yield from self._photo_stage()
        self.prediction.photos_s = self.env.now
        yield from self._group_stage()
        self.prediction.groups_s = self.env.now - self.prediction.photos_s
        self.prediction.busy = self._busy_s / (self.env.now * self.shape.num_workers)
        self.prediction.end_s = self.costs.end.at(self.num_photos)
        yield from self._compute(self.prediction.end_s)
        self.prediction.wall_s = self.env.now

    def _photo_stage(self) -> Steps:
        """As ``cluster/photo_stage.py``: batches are described, then matched, and enter in order,
        several ahead of those that have entered."""
        costs, threads = self.costs, self.shape.num_workers
        size = batch_size(self.num_photos, threads, self.shape.batch_size)
        left, described, stored, to_match = self.num_photos, 0, 0, 0
        describing: deque[_Batch] = deque()
        matching: deque[_Batch] = deque()
        while True:
            while self._under_way < most_under_way(threads):
                ahead = sum(b.num_photos for b in (*describing, *matching)) + to_match
                if to_match >= size or (to_match and not left and not describing):
                    batch = _Batch(min(size, to_match), costs.match)
                    to_match -= min(size, to_match)
                    matching.append(batch)
                elif left and ahead < most_ahead(threads, size):
                    batch = _Batch(min(size, left), costs.describe)
                    left -= min(size, left)
                    describing.append(batch)
                else:
                    break
                self._submit(batch)
            if not self._under_way:
                return
            yield from self._wait()
            while describing and describing[0].is_done:
                come = round(describing.popleft().num_photos)
                yield from self._compute(costs.retrieve.between(described, described + come))
                described, to_match = described + come, to_match + come
            while matching and matching[0].is_done:
                come = round(matching.popleft().num_photos)
                yield from self._compute(costs.store.between(stored, stored + come))
                stored += come

    def _group_stage(self) -> Steps:
        """As ``cluster/group_stage.py``: groups are grown, and joined two at a time."""
        costs, threads = self.costs, self.shape.num_workers
        yield from self._compute(costs.cut.at(self.num_photos))
        ready = deque(self._plan_groups(num_parts(self.num_photos, costs.group_size, threads)))
        read, taken = 0.0, 0.0
        while ready or self._under_way:
            while ready and self._under_way < most_under_way(threads):
                batch = ready.popleft()
                yield from self._compute(costs.group.between(read, read + batch.num_photos) / 2)
                read += batch.num_photos
                self._submit(batch)
            batch = yield from self._wait()
            come = batch.num_photos
            yield from self._compute(costs.group.between(taken, taken + come) / 2)
            yield from self._compute(costs.take.between(taken, taken + come))
            taken += come
            union = batch.union
            if union is not None:
                union.num_parts_left -= 1
                if union.num_parts_left == 0:
                    ready.appendleft(union)

    def _plan_groups(self, number: int) -> list[_Batch]:
        """Groups of one size, and in ``union`` what they are joined to: in rounds of pairs, as
        ``cluster/join_plan.py`` does it, until two are left."""
        size = self.num_photos / number * (1 + self.costs.overlap if number > 1 else 1)
        groups = [_Batch(size, self.costs.grow) for _ in range(number)]
        active = list(groups)
        while len(active) > LEFT:
            num_joins = min(len(active) // 2, len(active) - LEFT)
            unions = []
            for first, second in zip(
                active[: 2 * num_joins : 2], active[1 : 2 * num_joins : 2], strict=True
            ):
                union = _Batch(first.num_photos + second.num_photos, self.costs.join)
                first.union = second.union = union
                unions.append(union)
            active = [*active[2 * num_joins :], *unions]
        return groups

    def _submit(self, batch: _Batch) -> None:
        self._under_way += 1
        self.env.process(self._task(batch))

    def _wait(self) -> Generator[simpy.Event, Any, _Batch]:
        batch: _Batch = yield self._ended.get()
        batch.is_done = True
        self._under_way -= 1
        return batch

    def _task(self, batch: _Batch) -> Steps:
        with self._workers.request() as worker:
            yield worker
            started = self.env.now
            with self._way.request() as way:
                yield way
                num_bytes = batch.num_photos * batch.kind.num_bytes
                yield self.env.timeout(num_bytes / self.shape.bytes_per_second)
            yield from self._compute(batch.num_photos * batch.kind.seconds)
            self._busy_s += self.env.now - started
        yield self._ended.put(batch)

    def _compute(self, seconds: float) -> Steps:
        """With one core, that others may want too."""
        if self._cores is None:
            yield self.env.timeout(seconds)
            return
        while seconds > 0:
            with self._cores.request() as core:
                yield core
                taken = min(seconds, _SLICE_S)
                yield self.env.timeout(taken)
            seconds -= taken

"""Tasks under way on the cluster: a bounded number, each tried three times, all counted."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from sfm_front.cluster.connection import Cluster
from sfm_front.cluster.entry import run_task
from sfm_front.cluster.figures import Figures
from sfm_front.cluster.work import Answer, RunSettings, pack, unpack
from sfm_front.errors import InputError
from sfm_front.runtime.closeable import Closeable

if TYPE_CHECKING:
    from distributed import Future

# Larger ones go to a worker directly, not through the scheduler.
_LARGE = 2**20
# Seconds after which one looks whether new workers have come.
_LOOK_S = 5.0
# A worker that is never there.
_NOBODY = "nobody"
# How long workers may all be away.
_PATIENCE_S = 600.0


@dataclass(slots=True, eq=False)
class Task:
    """``work`` is made anew for each try; ``photos`` are named if it fails. ``done`` is called with
    the result, ``failed`` with the reason."""

    kind: str
    photos: Sequence[str]
    work: Callable[[], Any]
    done: Callable[[Any, Answer], None]
    failed: Callable[[str], None]
    attempts: int = 0
    key: str = ""
    workers: frozenset[str] = frozenset()
    held: list[Any] = field(default_factory=list)


def most_under_way(num_threads: int) -> int:
    """Tasks handed out at once: each worker has one, and the next one is there when that ends."""
    return 2 * num_threads


class TaskQueue(Closeable):
    """Hands tasks to the workers, and their results to who asked, on the thread that waits."""

    def __init__(
        self, cluster: Cluster, settings: RunSettings, attempts: int, figures: Figures
    ) -> None:
        self._cluster = cluster
        self._settings = settings
        self._attempts = attempts
        self.figures = figures
        self._under_way: dict[str, Task] = {}
        self._ended: SimpleQueue[Future[Any]] = SimpleQueue()
        self._looked = time.monotonic()
        self._missed_since: float | None = None
        # Of each kind of which none has succeeded yet.
        self._given_up: Counter[str] = Counter()

    @property
    def num_threads(self) -> int:
        """Tasks that can run at once; one, while all workers are away."""
        return max(1, self._cluster.num_threads)

    @property
    def num_under_way(self) -> int:
        """Tasks that are handed out."""
        return len(self._under_way)

    @property
    def is_full(self) -> bool:
        """Whether no more are handed out until some have ended."""
        return len(self._under_way) >= most_under_way(self.num_threads)

    def submit(self, task: Task) -> None:
        """Hand it out."""
        task.attempts += 1
        parcel = pack((self._settings, task.work()))
        task.key = f"{task.kind}-{uuid4().hex}"
        client, task.workers = self._cluster.client, self._cluster.workers
        # With none it waits: without a name, it would run on any.
        names = list(task.workers) or [_NOBODY]
        sent = self._sent(parcel, names) if task.workers and len(parcel) > _LARGE else parcel
        if client.status != "running":
            raise self._gone()
        future = client.submit(run_task, task.kind, sent, key=task.key, pure=False, workers=names)
        task.held = [sent, future]
        self._under_way[task.key] = task
        self.figures.begin()
        future.add_done_callback(self._ended.put)

    def _sent(self, parcel: bytes, names: list[str]) -> Any:
        """On one of these workers; if that one has just died, it goes through the scheduler."""
        from distributed import CancelledError

        try:
            return self._cluster.client.scatter(parcel, workers=names, direct=True, hash=False)
        except (OSError, CancelledError, TimeoutError, KeyError, ValueError):
            return parcel

    def wait(self, seconds: float = 0.5) -> None:
        """Take the results that have come, or wait so long for one."""
        if time.monotonic() - self._looked > _LOOK_S:
            self._looked = time.monotonic()
            self._check()
        try:
            future = self._ended.get(timeout=seconds)
        except Empty:
            return
        task = self._under_way.pop(future.key, None)
        if task is None:
            return  # it was given up
        task.held = []
        self.figures.end()
        self._take(task, future)

    def close(self) -> None:
        """Forget what is under way."""
        self._under_way.clear()

    def _check(self) -> None:
        client = self._cluster.client
        if client.status != "running":
            raise self._gone()
        self._cluster.look()
        there = self._cluster.workers
        if not there:
            self._miss_workers()
            return
        self._missed_since = None
        for task in [task for task in self._under_way.values() if not task.workers & there]:
            # All those that it may run on are gone; others have come.
            del self._under_way[task.key]
            self.figures.end()
            client.cancel([task.held[-1]], force=True)
            task.attempts -= 1
            self.submit(task)

    def _miss_workers(self) -> None:
        """Tell that none is there; raise InputError once that has lasted."""
        now = time.monotonic()
        if self._missed_since is None:
            self._missed_since = now
            self._cluster.note(f"no worker of {self._cluster.address} is there: waiting for one")
        elif now - self._missed_since > _PATIENCE_S:
            raise InputError(
                f"{self._cluster.address}: no worker has come back in {_PATIENCE_S / 60:.0f} "
                "minutes. Start some: the same command goes on from here."
            )

    def _take(self, task: Task, future: Future[Any]) -> None:
        from distributed import CancelledError, KilledWorker

        try:
            answer: Answer = self._cluster.client.gather(future, direct=True)
        except KilledWorker:
            self.figures.lost += 1
            self._give_up(task, "the workers that had it died")
            return
        except CancelledError as error:
            if self._cluster.client.status != "running":
                raise self._gone() from error
            self._try_again(task, "its worker died")
            return
        except Exception as error:  # whatever a library raises there
            self._try_again(task, _in_one_line(error))
            return
        self.figures.add(task.kind, answer)
        task.done(unpack(answer.result), answer)

    def _try_again(self, task: Task, reason: str) -> None:
        self.figures.lost += 1
        if task.attempts < self._attempts:
            self.submit(task)
        else:
            self._give_up(task, reason)

    def _give_up(self, task: Task, reason: str) -> None:
        if self.figures.mean_seconds(task.kind) is None:
            self._given_up[task.kind] += 1
            if self._given_up[task.kind] >= self._attempts:
                raise InputError(
                    f"no worker of {self._cluster.address} can {task.kind} photos: {reason}"
                )
        task.failed(reason)

    def _gone(self) -> InputError:
        return InputError(
            f"{self._cluster.address}: the scheduler is gone. Start it and its workers again: the "
            "same command goes on from here."
        )


def _in_one_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__

"""Tasks under way on the cluster: a bounded number, each tried three times, all counted."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from sfm_front.cluster.connection import Cluster
from sfm_front.cluster.entry import run_task
from sfm_front.cluster.figures import Figures
from sfm_front.cluster.work import Answer, RunSettings, WrongVersionError, pack, unpack
from sfm_front.errors import InputError
from sfm_front.runtime.closeable import Closeable

if TYPE_CHECKING:
    from distributed import Future

# Larger ones go to a worker directly, not through the scheduler.
_LARGE = 2**20
# Seconds after which one looks whether new workers have come.
_LOOK_S = 5.0


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
        self._threads = max(1, cluster.num_threads())

    @property
    def num_threads(self) -> int:
        """Tasks that can run at once."""
        return self._threads

    @property
    def num_under_way(self) -> int:
        """Tasks that are handed out."""
        return len(self._under_way)

    @property
    def is_full(self) -> bool:
        """Whether no more are handed out until some have ended."""
        return len(self._under_way) >= most_under_way(self._threads)

    def submit(self, task: Task) -> None:
        """Hand it out."""
        from distributed import CancelledError

        task.attempts += 1
        parcel = pack((self._settings, pack(task.work())))
        task.key = f"{task.kind}-{uuid4().hex}"
        client = self._cluster.client
        sent: Any = parcel
        try:
            if len(parcel) > _LARGE:
                sent = client.scatter(parcel, direct=True, hash=False)
            future = client.submit(run_task, task.kind, sent, key=task.key, pure=False)
        except (OSError, CancelledError, TimeoutError) as error:
            raise self._gone() from error
        task.held = [sent, future]
        self._under_way[task.key] = task
        self.figures.begin()
        future.add_done_callback(self._ended.put)

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

    def give_up(self) -> None:
        """Whatever is under way is no longer wanted."""
        futures = [task.held[-1] for task in self._under_way.values()]
        for _ in self._under_way:
            self.figures.end()
        self._under_way.clear()
        self._cluster.client.cancel(futures, force=True)

    def close(self) -> None:
        """Forget what is under way."""
        self._under_way.clear()

    def _check(self) -> None:
        client = self._cluster.client
        if client.status != "running":
            raise self._gone()
        self._cluster.check_workers()
        self._threads = max(1, self._cluster.num_threads())

    def _take(self, task: Task, future: Future[Any]) -> None:
        from distributed import CancelledError, KilledWorker

        try:
            answer: Answer = self._cluster.client.gather(future, direct=True)
        except WrongVersionError as error:
            self._cluster.refuse(error.address, error.found)
            task.attempts -= 1  # nobody has tried it
            self.submit(task)
            return
        except KilledWorker:
            task.failed("the workers that had it died")
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
            task.failed(reason)

    def _gone(self) -> InputError:
        return InputError(
            f"{self._cluster.address}: the scheduler is gone. Start it and its workers again: the "
            "same command goes on from here."
        )


def _in_one_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__

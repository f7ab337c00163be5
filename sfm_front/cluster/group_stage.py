"""The whole view graph → models of groups, grown and joined by the workers."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from sfm_front.cluster.group_inputs import GroupInputs
from sfm_front.cluster.groups import cut
from sfm_front.cluster.growing import unpacked
from sfm_front.cluster.join_plan import Node, plan_joins
from sfm_front.cluster.options import ClusterOptions
from sfm_front.cluster.task_queue import Task, TaskQueue
from sfm_front.cluster.work import GROW, JOIN, Answer, GrownModel, JoinWork
from sfm_front.cluster.working_folder import WorkingFolder, key_of, key_of_join
from sfm_front.reports.cluster_outcome import FailedTask, GroupOutcome
from sfm_front.session.given import GivenSession


@dataclass(slots=True, eq=False)
class _Done:
    """What became of a node: its models, also by their ids in the session."""

    key: str
    models: Sequence[GrownModel]
    model_ids: Sequence[int]


class GroupStage:
    """Has models grown of all photos that are in none, and joined two groups at a time."""

    def __init__(
        self,
        session: GivenSession,
        queue: TaskQueue,
        folder: WorkingFolder,
        options: ClusterOptions,
        on_progress: Callable[[], None],
    ) -> None:
        self._session = session
        self._queue = queue
        self._folder = folder
        self._options = options
        self._on_progress = on_progress
        self._inputs = GroupInputs(session)
        self._nodes: list[Node] = []
        self._done: dict[int, _Done] = {}
        self._ready: deque[int] = deque()
        # Of a node that has been paired: its union.
        self._union_of: dict[int, int] = {}

    @property
    def num_groups(self) -> int:
        """Groups there are."""
        return sum(node.parts is None for node in self._nodes)

    @property
    def num_grown(self) -> int:
        """Groups that are done."""
        return sum(self._nodes[number].parts is None for number in self._done)

    @property
    def num_joins(self) -> int:
        """Joins that workers are to do."""
        return len(self._nodes) - self.num_groups

    @property
    def num_joined(self) -> int:
        """Joins that are done."""
        return len(self._done) - self.num_grown

    def run(self) -> None:
        """Until the models of all groups are in the session."""
        session, figures = self._session, self._queue.figures
        with figures.serial("cut"):
            groups = cut(
                session.view_graph,
                session.waiting,
                group_size=self._options.group_size,
                overlap=self._options.overlap,
                num_workers=self._queue.num_threads,
            )
            self._nodes = plan_joins(session.view_graph, groups)
        if not groups:
            return
        session.begin_growing()
        self._ready.extend(range(len(groups)))
        for number, node in enumerate(self._nodes):
            self._union_of.update(dict.fromkeys(node.parts or (), number))
        while True:
            while self._ready and not self._queue.is_full:
                self._hand_out(self._ready.popleft())
            self._on_progress()
            if not self._queue.num_under_way and not self._ready:
                break
            self._queue.wait()
        session.end_growing()

    def _hand_out(self, number: int) -> None:
        node = self._nodes[number]
        with self._queue.figures.serial("group"):
            if node.parts is None:
                key = key_of(self._inputs.of(node.photos))
            else:
                key = key_of_join(*(self._done[part].key for part in node.parts))
            found = self._folder.load_models(key)
        if found is not None:
            self._take(number, key, found, None)
            return
        self._queue.submit(
            Task(
                GROW if node.parts is None else JOIN,
                [self._session.name(image_id) for image_id in node.photos],
                partial(self._work, node),
                partial(self._made, number, key),
                partial(self._not_made, number, key),
            )
        )

    def _work(self, node: Node) -> object:
        group = self._inputs.of(node.photos)
        if node.parts is None:
            return group
        return JoinWork(group, tuple(m for part in node.parts for m in self._done[part].models))

    def _made(self, number: int, key: str, models: Sequence[GrownModel], answer: Answer) -> None:
        with self._queue.figures.serial("group"):
            self._folder.save_models(key, models)
        self._take(number, key, models, answer)

    def _take(
        self, number: int, key: str, models: Sequence[GrownModel], answer: Answer | None
    ) -> None:
        node = self._nodes[number]
        self._queue.figures.groups.append(
            GroupOutcome(
                photos=len(node.photos),
                is_join=node.parts is not None,
                registered=max((model.num_registered for model in models), default=0),
                models=len(models),
                seconds=answer.seconds if answer else 0.0,
                bytes_in=answer.bytes_in if answer else 0,
                bytes_out=answer.bytes_out if answer else 0,
            )
        )
        before = [i for part in node.parts or () for i in self._done[part].model_ids]
        with self._queue.figures.serial("take models"):
            model_ids = self._session.take_models(unpacked(models), in_place_of=before)
        self._end(number, _Done(key, models, model_ids))

    def _not_made(self, number: int, key: str, reason: str) -> None:
        node = self._nodes[number]
        names = tuple(self._session.name(image_id) for image_id in node.photos)
        kind = GROW if node.parts is None else JOIN
        self._queue.figures.failed.append(FailedTask(kind=kind, reason=reason, photos=names))
        # What could not be joined here goes on as it is.
        parts = [self._done[part] for part in node.parts or ()]
        models = [model for part in parts for model in part.models]
        self._end(number, _Done(key, models, [i for part in parts for i in part.model_ids]))

    def _end(self, number: int, done: _Done) -> None:
        self._done[number] = done
        for part in self._nodes[number].parts or ():
            self._done[part].models = ()  # They take memory.
        union = self._union_of.get(number)
        if union is None:
            done.models = ()
        elif all(part in self._done for part in self._nodes[union].parts or ()):
            self._ready.appendleft(union)

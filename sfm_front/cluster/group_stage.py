"""The whole view graph → models of groups, each grown by one worker."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from sfm_front.cluster.groups import cut
from sfm_front.cluster.growing import unpacked
from sfm_front.cluster.options import ClusterOptions
from sfm_front.cluster.task_queue import Task, TaskQueue
from sfm_front.cluster.work import GROW, Answer, GroupPhoto, GroupWork, GrownModel
from sfm_front.cluster.working_folder import WorkingFolder, key_of
from sfm_front.reports.cluster_outcome import FailedTask, GroupOutcome
from sfm_front.session.given import GivenSession

_NO_MATCHES = np.zeros((0, 2), np.uint32)


class GroupStage:
    """Has models grown of all photos that are in none."""

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
        self.num_groups = 0
        self.num_done = 0

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
        self.num_groups = len(groups)
        if not groups:
            return
        session.begin_growing()
        left = iter(groups)
        while True:
            while not self._queue.is_full and (group := next(left, None)) is not None:
                self._grow(group)
            self._on_progress()
            if not self._queue.num_under_way:
                break
            self._queue.wait()
        session.end_growing()

    def _grow(self, group: Sequence[int]) -> None:
        with self._queue.figures.serial("group"):
            work = self._work(group)
            key = key_of(work)
            found = self._folder.load_models(key)
        if found is not None:
            self._take(group, found, None)
            return
        names = [photo.name for photo in work.photos]
        self._queue.submit(
            Task(
                GROW,
                names,
                lambda: self._work(group),
                partial(self._grown, group, key),
                partial(self._not_grown, names),
            )
        )

    def _work(self, group: Sequence[int]) -> GroupWork:
        members, database = set(group), self._session.database
        cameras = {image_id: self._session.camera(image_id) for image_id in group}
        photos = tuple(
            GroupPhoto(
                image_id,
                self._session.name(image_id),
                cameras[image_id].camera_id,
                np.ascontiguousarray(database.keypoints(image_id)[0][:, :2]),
            )
            for image_id in group
        )
        pairs = {
            image_id: tuple(
                replace(pair, matches=_NO_MATCHES)  # a view graph has no use for others
                for pair in database.pairs(image_id)
                if pair.image_id2 in members
            )
            for image_id in group
        }
        return GroupWork(photos, {c.camera_id: c for c in cameras.values()}, pairs)

    def _grown(
        self, group: Sequence[int], key: str, models: Sequence[GrownModel], answer: Answer
    ) -> None:
        with self._queue.figures.serial("group"):
            self._folder.save_models(key, models)
        self._take(group, models, answer)

    def _take(
        self, group: Sequence[int], models: Sequence[GrownModel], answer: Answer | None
    ) -> None:
        self._queue.figures.groups.append(
            GroupOutcome(
                photos=len(group),
                registered=max((model.num_registered for model in models), default=0),
                models=len(models),
                seconds=answer.seconds if answer else 0.0,
                bytes_in=answer.bytes_in if answer else 0,
                bytes_out=answer.bytes_out if answer else 0,
            )
        )
        with self._queue.figures.serial("take models"):
            self._session.take_models(unpacked(models))
        self.num_done += 1

    def _not_grown(self, names: Sequence[str], reason: str) -> None:
        self._queue.figures.failed.append(FailedTask(kind=GROW, reason=reason, photos=tuple(names)))
        self.num_done += 1

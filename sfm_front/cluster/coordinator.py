"""Photos → an output, by the workers of a cluster: the coordinator's side, from end to end."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from uuid import uuid4

from sfm_front.cluster.connection import Cluster
from sfm_front.cluster.features import FeatureStore
from sfm_front.cluster.figures import Figures
from sfm_front.cluster.group_stage import GroupStage
from sfm_front.cluster.options import ClusterOptions
from sfm_front.cluster.photo_stage import PhotoStage, batch_size
from sfm_front.cluster.storage_probe import all_see_photo, all_see_token
from sfm_front.cluster.task_queue import TaskQueue
from sfm_front.cluster.work import DESCRIBE, GROW, JOIN, MATCH, RunSettings
from sfm_front.cluster.workbench import extraction_settings
from sfm_front.cluster.working_folder import WorkingFolder
from sfm_front.session.given import GivenSession
from sfm_front.session.summing_up import SessionResult
from sfm_front.types import PhotoPath


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterProgress:
    """Where a run stands, over all workers. ``seconds_left`` of what is known, None before any."""

    num_photos: int
    num_described: int
    num_matched: int
    num_groups: int
    num_grown: int
    num_joins: int
    num_joined: int
    num_placed: int
    num_workers: int
    num_under_way: int
    seconds_left: float | None


class Coordinator:
    """Holds the output and hands out the work; everything that it finishes is on its disk, so that
    another one goes on from there."""

    def __init__(
        self,
        session: GivenSession,
        cluster: Cluster,
        options: ClusterOptions,
        photos: Sequence[PhotoPath],
        on_progress: Callable[[ClusterProgress], None],
    ) -> None:
        """``photos``: those that the session does not hold, in order."""
        self._session = session
        self._cluster = cluster
        self._options = options
        self._report = on_progress
        self._folder = WorkingFolder(session.output)
        self._figures = Figures()
        descriptor, weights = session.global_descriptor, session.options.weights
        with self._figures.serial("probe"):
            token, content = self._folder.write_token()
            self.is_shared = all_see_token(cluster, token, content)
            sees_photos = not photos or all_see_photo(cluster, photos[0].path)
        settings = RunSettings(
            run_id=uuid4().hex,
            # By its parts: auto might find other weights on another machine.
            options=replace(
                session.options,
                global_descriptor=descriptor.name,
                weights=None if weights is None else weights.absolute(),
                threads=1,
            ),
            descriptor=descriptor.fingerprint,
            cache=self._folder.path if self.is_shared else None,
        )
        features = FeatureStore(
            self._folder.features,
            extraction_settings(session.options, descriptor),
            session.database,
            is_shared=self.is_shared,
            sees_photos=sees_photos,
        )
        for image_id, digest in session.restored():
            features.know(image_id, digest)
        self._queue = TaskQueue(cluster, settings, options.attempts, self._figures)
        self._batch_size = batch_size(len(photos), self._queue.num_threads, options.batch_size)
        self._photos = PhotoStage(
            session, self._queue, features, photos, self._batch_size, self._tell
        )
        self._groups = GroupStage(session, self._queue, self._folder, options, self._tell)

    @property
    def num_taken(self) -> int:
        """Photos of those given that the session holds by now, used or not."""
        return self._photos.num_entered

    def run(self, is_stopped: Callable[[], bool]) -> SessionResult:
        """All of it. Once it is stopped, no more photos are begun: those taken so far are finished
        with."""
        self._photos.run(is_stopped)
        self._groups.run()
        self._queue.close()
        self._session.note_cluster(
            self._figures.outcome(
                scheduler=self._cluster.address,
                dashboard=self._cluster.dashboard,
                shared_storage=self.is_shared,
                group_size=self._options.group_size,
            )
        )
        return self._session.finish(self._photos.num_photos - self.num_taken)

    def _tell(self) -> None:
        photos, groups = self._photos, self._groups
        self._report(
            ClusterProgress(
                num_photos=photos.num_photos,
                num_described=photos.num_described,
                num_matched=photos.num_entered,
                num_groups=groups.num_groups,
                num_grown=groups.num_grown,
                num_joins=groups.num_joins,
                num_joined=groups.num_joined,
                num_placed=self._session.num_placed,
                num_workers=self._queue.num_threads,
                num_under_way=self._queue.num_under_way,
                seconds_left=self._seconds_left(),
            )
        )

    def _seconds_left(self) -> float | None:
        """Of the tasks known by now, by what such tasks took."""
        photos, groups = self._photos, self._groups
        tasks = {
            DESCRIBE: (photos.num_photos - photos.num_described) / self._batch_size,
            MATCH: (photos.num_photos - photos.num_entered) / self._batch_size,
            GROW: float(groups.num_groups - groups.num_grown),
            JOIN: float(groups.num_joins - groups.num_joined),
        }
        left = 0.0
        for kind, number in tasks.items():
            seconds = self._figures.mean_seconds(kind)
            if number and seconds is None:
                return None
            left += number * (seconds or 0.0)
        return left / self._queue.num_threads

"""Photos → described, matched, in the database: batches on the workers, in order here."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice

from sfm_front.cluster.features import FeatureStore
from sfm_front.cluster.task_queue import Task, TaskQueue
from sfm_front.cluster.work import (
    DESCRIBE,
    MATCH,
    Answer,
    Described,
    MatchedPhoto,
    MatchWork,
    Query,
)
from sfm_front.reports.cluster_outcome import FailedTask
from sfm_front.session.given import Arrival, GivenSession
from sfm_front.types import ExtractedPhoto, PhotoPath, Skipped, SkipReason


def batch_size(num_photos: int, num_threads: int, most: int) -> int:
    """Photos of a task: few enough that each worker gets several, enough to be worth the way."""
    return max(min(2, most), min(most, -(-num_photos // (4 * num_threads))))


def most_ahead(num_threads: int, batch_size: int) -> int:
    """Photos that may be under way at once."""
    return 6 * num_threads * batch_size


class PhotoStage:
    """Takes photos in as a session does, several batches ahead of what is matched."""

    def __init__(
        self,
        session: GivenSession,
        queue: TaskQueue,
        features: FeatureStore,
        photos: Sequence[PhotoPath],
        batch_size: int,
        on_progress: Callable[[], None],
    ) -> None:
        self._session = session
        self._queue = queue
        self._features = features
        self._photos = iter(photos)
        self._batch_size = batch_size
        self._on_progress = on_progress
        self.num_photos = len(photos)
        self.num_described = 0
        self.num_entered = 0
        # Photos handed out to be described, in order, each with what came of it.
        self._describing: deque[_Slot] = deque()
        self._to_match: list[Arrival] = []
        # Photos handed out to be matched, in order.
        self._matching: deque[Arrival] = deque()
        self._matched: dict[int, MatchedPhoto] = {}
        self._is_drained = False

    def run(self, is_stopped: Callable[[], bool]) -> None:
        """Until all photos are in the session, or those that were begun when it is stopped."""
        while True:
            self._hand_out(is_stopped())
            if not self._queue.num_under_way:
                return
            self._queue.wait()
            self._on_progress()

    def _hand_out(self, stopped: bool) -> None:
        self._is_drained |= stopped
        while not self._queue.is_full:
            # What is matched enters, and makes room.
            if len(self._to_match) >= self._batch_size or (self._to_match and self._is_last):
                self._submit_match(self._to_match[: self._batch_size])
                del self._to_match[: self._batch_size]
            elif self._is_drained or self._is_far_ahead:
                return
            else:
                self._submit_describe()

    @property
    def _is_last(self) -> bool:
        """Whether no more photos will come to be matched."""
        return self._is_drained and not self._describing

    @property
    def _is_far_ahead(self) -> bool:
        """Features of photos that have not entered are held in memory."""
        ahead = len(self._describing) + len(self._to_match) + len(self._matching)
        return ahead >= most_ahead(self._queue.num_threads, self._batch_size)

    # Describing

    def _submit_describe(self) -> None:
        slots = [_Slot(photo) for photo in islice(self._photos, self._batch_size)]
        if len(slots) < self._batch_size:
            self._is_drained = True
        if not slots:
            return
        for slot in slots:
            self._session.announce(slot.photo)
        self._describing += slots
        self._describe(slots)

    def _describe(self, slots: Sequence[_Slot]) -> None:
        self._queue.submit(
            Task(
                DESCRIBE,
                [slot.photo.name for slot in slots],
                lambda: tuple(self._features.file_of(slot.photo) for slot in slots),
                partial(self._described, slots),
                partial(self._not_described, slots),
            )
        )

    def _described(
        self, slots: Sequence[_Slot], found: Sequence[Described], _answer: Answer
    ) -> None:
        for slot, photo in zip(slots, found, strict=True):
            slot.found = (
                photo
                if isinstance(photo, Skipped)
                else self._features.taken(photo, slot.photo.path)
            )
        self._take_described()

    def _not_described(self, slots: Sequence[_Slot], reason: str) -> None:
        if len(slots) > 1:
            for slot in slots:  # to find out which one it is
                self._describe([slot])
            return
        name = slots[0].photo.name
        self._note_failed(DESCRIBE, reason, name)
        slots[0].found = Skipped(name, SkipReason.UNREADABLE, f"given up: {reason}")
        self._take_described()

    def _take_described(self) -> None:
        """What is there of the photos that come first."""
        with self._queue.figures.serial("retrieve"):
            while self._describing and self._describing[0].found is not None:
                found = self._describing.popleft().found
                assert found is not None
                self.num_described += 1
                arrival = self._session.arrive(found)
                if arrival is None:
                    self.num_entered += 1
                    continue
                self._features.know(arrival.view.image_id, arrival.photo.digest)
                self._to_match.append(arrival)

    # Matching

    def _submit_match(self, arrivals: Sequence[Arrival]) -> None:
        self._matching += arrivals
        self._match(arrivals)

    def _match(self, arrivals: Sequence[Arrival]) -> None:
        self._queue.submit(
            Task(
                MATCH,
                [arrival.photo.name for arrival in arrivals],
                partial(self._match_work, arrivals),
                self._match_done,
                partial(self._not_matched, arrivals),
            )
        )

    def _match_work(self, arrivals: Sequence[Arrival]) -> MatchWork:
        queries = tuple(Query(a.view.image_id, a.candidates) for a in arrivals)
        image_ids = {query.image_id for query in queries}
        image_ids.update(c.image_id for query in queries for c in query.candidates)
        keys, sent = self._features.for_workers(image_ids)
        cameras = {image_id: self._session.camera(image_id) for image_id in image_ids}
        return MatchWork(queries, cameras, keys, sent)

    def _match_done(self, found: Sequence[MatchedPhoto], _answer: Answer) -> None:
        self._matched.update({photo.image_id: photo for photo in found})
        self._enter_matched()

    def _not_matched(self, arrivals: Sequence[Arrival], reason: str) -> None:
        if len(arrivals) > 1:
            for arrival in arrivals:
                self._match([arrival])
            return
        image_id = arrivals[0].view.image_id
        self._note_failed(MATCH, reason, arrivals[0].photo.name)
        self._matched[image_id] = MatchedPhoto(image_id, (), (), {}, {})
        self._enter_matched()

    def _enter_matched(self) -> None:
        """What is there of the photos that come first."""
        with self._queue.figures.serial("store"):
            while self._matching and self._matching[0].view.image_id in self._matched:
                arrival = self._matching.popleft()
                found = self._matched.pop(arrival.view.image_id)
                self._session.enter(
                    arrival, found.ranked, found.pairs, found.rejected, found.seconds
                )
                self.num_entered += 1

    def _note_failed(self, kind: str, reason: str, name: str) -> None:
        self._queue.figures.failed.append(FailedTask(kind=kind, reason=reason, photos=(name,)))


class _Slot:
    """A photo in its place, and what came of it."""

    def __init__(self, photo: PhotoPath) -> None:
        self.photo = photo
        self.found: ExtractedPhoto | Skipped | None = None

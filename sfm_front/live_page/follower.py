"""All that is known of an output at one moment, from the files that its session writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.live_page.model_shapes import ModelReader, Models, ModelShape
from sfm_front.reports import event_log, report_json
from sfm_front.reports.event_tail import EventTail
from sfm_front.reports.run_summary import RunSummary
from sfm_front.reports.standing import Standing, standing
from sfm_front.reports.story import GIVEN_UP, PhotoState, PhotoStory, Story
from sfm_front.reports.verdict import Verdict, verdict
from sfm_front.storage.colmap_models import is_model


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """What became of a photo: its state, the place of its model among the models, or why it has
    none and what would help, where that is known. ``is_weak``: few other photos hold it."""

    photo: PhotoStory
    state: PhotoState
    model: int | None
    reason: str = ""
    hint: str = ""
    is_weak: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """``models``: those of ``sparse/``. ``fresh``: photos that were placed since these were
    written, whose poses are in the same frames. ``outcomes`` by name, in order of arrival.
    ``verdict``: once the session has finished. ``standing``: how it stands, of a session."""

    story: Story
    models: Sequence[ModelShape]
    fresh: Sequence[PhotoStory]
    outcomes: Mapping[str, Outcome]
    verdict: Verdict | None = None
    standing: Standing = Standing.RUNS

    def named(self, state: PhotoState) -> list[Outcome]:
        """The photos in this state."""
        return [one for one in self.outcomes.values() if one.state is state]

    @property
    def newest(self) -> PhotoStory | None:
        """The photo that came last, while others may follow."""
        return self.story.newest if self.standing is Standing.RUNS else None

    @property
    def weak(self) -> list[Outcome]:
        """Photos in a model that few others hold."""
        return [one for one in self.outcomes.values() if one.is_weak]


class OutputFollower:
    """Looks at an output again and again."""

    def __init__(self, output: Path) -> None:
        """``output`` of a session, or a COLMAP model of any program."""
        self._output = output
        self._tail = EventTail(output / event_log.FILE)
        self._reader = ModelReader(output if is_model(output) else output / "sparse")
        self._story = Story()
        self._models = Models([], 0.0)
        self._summary: RunSummary | None = None
        self._standing = Standing.RUNS
        self._has_looked = False

    def look(self) -> Seen | None:
        """What is known now; None if nothing has changed since the last look."""
        is_new = self._hear()
        stands = standing(self._story, self._output)
        if stands is Standing.BROKEN_OFF and self._hear():  # Its end, and then its lock was gone.
            is_new, stands = True, standing(self._story, self._output)
        models = self._reader.new()
        if models is None and not is_new and stands is self._standing and self._has_looked:
            return None
        self._standing = stands
        self._has_looked = True
        self._models = models or self._models
        if self._story.ended:
            self._summary = self._read_summary()
        return self._seen()

    def _hear(self) -> bool:
        """Whether anything was told since the last time."""
        events, is_anew = self._tail.new()
        if is_anew:
            self._story, self._models, self._summary = Story(), Models([], 0.0), None
        for event in events:
            self._story.tell(event)
        return is_anew or bool(events)

    def _seen(self) -> Seen:
        shapes, written = self._models.shapes, self._models.written
        place_of = {shape.model_id: place for place, shape in enumerate(shapes)}
        in_model = {name: place for place, shape in enumerate(shapes) for name in shape.names}
        fresh = [
            photo
            for photo in self._story.photos.values()
            if photo.pose is not None
            and photo.state is PhotoState.PLACED
            and photo.name not in in_model
            and photo.time > written
            and photo.pose.model_id in place_of
            and self._story.moved.get(photo.pose.model_id, 0.0) <= written
        ]
        for photo in fresh:
            assert photo.pose is not None
            in_model[photo.name] = place_of[photo.pose.model_id]
        photos = dict(self._story.photos)
        for shape in shapes:  # Of models without events, or whose events are lost.
            for name in shape.names:
                photos.setdefault(name, PhotoStory(name, PhotoState.PLACED))
        summary = self._summary
        hints = {} if summary is None else {photo.name: photo.hint for photo in summary.used}
        outcomes = {
            name: self._outcome(photo, in_model, written, hints.get(name, ""))
            for name, photo in photos.items()
        }
        judged = None if summary is None else verdict(summary, summary.sidecar)
        return Seen(self._story, shapes, fresh, outcomes, judged, self._standing)

    def _outcome(
        self, photo: PhotoStory, in_model: Mapping[str, int], written: float, hint: str
    ) -> Outcome:
        model = in_model.get(photo.name)
        if model is not None:
            linked = sum(in_model.get(name) == model for name in photo.links)
            is_weak = photo.image_id is not None and linked < self._story.few_pairs
            return Outcome(photo, PhotoState.PLACED, model, is_weak=is_weak)
        if photo.state is PhotoState.PLACED and photo.time > written:
            # The models that hold it are still to be written.
            return Outcome(photo, PhotoState.PLACED, None)
        if photo.state is PhotoState.PLACED:
            return Outcome(photo, PhotoState.WAITING, None, GIVEN_UP, hint)
        return Outcome(photo, photo.state, None, photo.reason, hint)

    def _read_summary(self) -> RunSummary | None:
        try:
            return report_json.read_report(self._output)
        except InputError:
            return None

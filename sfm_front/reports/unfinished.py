"""The summary of a session that has not ended, from what it has written to its output so far."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pycolmap

from sfm_front.reports.camera_outcome import camera_outcomes
from sfm_front.reports.run_summary import ModelOutcome, Outcome, PhotoOutcome, RunSummary, Totals
from sfm_front.reports.standing import Standing, how_to_go_on
from sfm_front.reports.story import GIVEN_UP, PhotoState, PhotoStory, Story
from sfm_front.reports.words import capitalized, counted, day_and_hour
from sfm_front.storage.stored_session import StoredSession
from sfm_front.storage.written_models import STATE, read_state
from sfm_front.types import ModelSummary, Skipped, StoredPhoto

_STILL_TO_BE_WRITTEN = "placed in a model that is still to be written"


@dataclass(frozen=True, slots=True)
class Moment:
    """When the models of a session were written: in seconds since 1970, and after how many of its
    photos, None without any. ``model_ids`` in the order of their folders."""

    time: float = 0.0
    num_photos: int | None = None
    model_ids: tuple[int, ...] = ()

    @property
    def paths(self) -> list[str]:
        """Of the models, relative to the output."""
        return [f"sparse/{number}" for number in range(len(self.model_ids))]

    @classmethod
    def of(cls, output: Path) -> Moment:
        """Without models if none were written yet. Raises OSError, ValueError, KeyError or
        TypeError where what is said of them cannot be read, as while it is replaced."""
        sparse = output / "sparse"
        content = read_state(sparse)
        if not content:
            return cls()
        return cls(
            (sparse / STATE).stat().st_mtime,
            int(content["num_photos"]),
            tuple(int(model["model_id"]) for model in content["models"]),
        )


def sum_up_so_far(
    output: Path,
    story: Story,
    session: StoredSession,
    moment: Moment,
    models: Sequence[pycolmap.Reconstruction],
) -> RunSummary:
    """As of the moment when ``models`` were written: photos that came later are left out."""
    written = [
        ModelSummary.of(model, output / path)
        for path, model in zip(moment.paths, models, strict=True)
    ]
    photos = _photos(story, session, moment, written)
    return RunSummary(
        photos=tuple(photos),
        models=tuple(
            ModelOutcome(
                model.path_in_output,
                model.num_registered,
                model.num_points,
                model.mean_reprojection_error_px,
                model.mean_track_length,
                audit=None,
            )
            for model in written
        ),
        end_seconds={},
        end_events=(),
        totals=_totals(story, photos, written),
        cameras=tuple(
            # Whether photos determine a camera is found out at the end.
            outcome
            for model in written
            if session.cameras
            for outcome in camera_outcomes(model, session.cameras, {}, 0.0)
        ),
    )


def words_so_far(story: Story, stands: Standing, moment: Moment) -> str:
    """How far a session is that is not finished, and what is left out of its summary. Its command
    follows."""
    words = f"{_how_it_stands(story, stands)} {_left_out(story, moment)}".strip()
    if stands is not Standing.RUNS:
        return f"{words} {capitalized(how_to_go_on(story))}"
    return f"{words} If that is long ago, it was killed; {how_to_go_on(story)}"


def words_of_stopped(story: Story) -> str:
    """Of a session that was stopped, and finished with the photos that it had; else empty. Its
    command follows."""
    if not story.num_left:
        return ""
    left = counted(story.num_left, "photo")
    words = f"Stopped at {day_and_hour(story.last)} with {left} to go, finished with the others."
    return f"{words} {capitalized(how_to_go_on(story))}"


def _how_it_stands(story: Story, stands: Standing) -> str:
    at = day_and_hour(story.last)
    if stands is Standing.STOPPED:
        return f"Stopped at {at}, before its end."
    if stands is Standing.BROKEN_OFF:
        return f"Broken off: nothing was heard after {at}, and no process here works on it."
    if story.step:
        return f"Not finished yet, but no more photos come. At {at}: {story.step}."
    return f"Not finished yet: this is how far it was at {at}."


def _left_out(story: Story, moment: Moment) -> str:
    states = Counter(photo.state for photo in story.photos.values())
    taken = len(story.photos) - states[PhotoState.ARRIVED] - states[PhotoState.DESCRIBED]
    taken -= states[PhotoState.SKIPPED]
    later = 0 if moment.num_photos is None else taken - moment.num_photos
    if later <= 0:
        return ""
    which = "has" if later == 1 else "have"
    return (
        f"{counted(later, 'photo')} {which} come since the models were written last, "
        "and will be here when they are written next."
    )


def _photos(
    story: Story, session: StoredSession, moment: Moment, models: Sequence[ModelSummary]
) -> list[Outcome]:
    """In order of arrival, as far as that was told."""
    model_of = {
        image_id: number
        for number, model in reversed([*enumerate(models)])
        for image_id in model.reconstruction.reg_image_ids()
    }
    used = session.photos[: moment.num_photos]
    outcomes: list[Outcome] = [
        _outcome(photo, story.photos.get(photo.name), model_of, moment) for photo in used
    ]
    turn = {name: place for place, name in enumerate(story.photos)}
    return sorted([*outcomes, *session.unused], key=lambda one: turn.get(one.name, -1))


def _outcome(
    photo: StoredPhoto,
    told: PhotoStory | None,
    model_of: Mapping[int, int],
    moment: Moment,
) -> PhotoOutcome:
    model = model_of.get(photo.image_id)
    if model is None and told and told.pose and told.state is PhotoState.PLACED:
        is_later = told.time > moment.time and told.pose.model_id in moment.model_ids
        model = moment.model_ids.index(told.pose.model_id) if is_later else None
    return PhotoOutcome(
        name=photo.name,
        image_id=photo.image_id,
        model=model,
        why_not=None if model is not None else _why_not(told, moment),
        waiting=told.waiting if told and told.state is PhotoState.WAITING else None,
        num_keypoints=photo.num_keypoints,
        most_relevant=photo.candidates[0].name if photo.candidates else None,
        num_verified=sum(candidate.verified for candidate in photo.candidates),
        num_rejected=sum(candidate.rejected is not None for candidate in photo.candidates),
        placed=(),
        seconds=told.seconds if told and told.seconds else photo.seconds,
        events=(),
    )


def _why_not(told: PhotoStory | None, moment: Moment) -> str:
    if told is None or told.state is not PhotoState.PLACED:
        return (told.reason if told else "") or "not tried yet"
    return _STILL_TO_BE_WRITTEN if told.time > moment.time else GIVEN_UP


def _totals(story: Story, photos: Sequence[Outcome], models: Sequence[ModelSummary]) -> Totals:
    used = [photo for photo in photos if not isinstance(photo, Skipped)]
    by_stage: Counter[str] = Counter()
    for photo in used:
        by_stage.update(photo.seconds)
    points = sum(model.num_points for model in models)
    error = sum(model.mean_reprojection_error_px * model.num_points for model in models)
    return Totals(
        num_photos=len(photos),
        num_used=len(used),
        num_registered=sum(photo.model is not None for photo in used),
        num_points=points,
        mean_reprojection_error_px=error / points if points else None,
        wall_seconds=(story.last or 0.0) - (story.began or 0.0),
        seconds_by_stage=dict(by_stage),
        median_seconds_by_quarter=(),
        peak_memory_bytes=None,
        latency=None,
    )

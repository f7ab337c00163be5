"""What is told of a photo once it was matched, stored and mapped."""

from __future__ import annotations

from collections.abc import Sequence

from sfm_front.events import ModelEvent, ModelRefined, PhotoAdded
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.session.parts import SessionParts
from sfm_front.types import CandidateOutcome, ExtractedPhoto


def photo_added(
    parts: SessionParts,
    photo: ExtractedPhoto,
    image_id: int,
    outcomes: tuple[CandidateOutcome, ...],
    registered: Sequence[int],
    clock: Stopwatch,
    events: tuple[ModelEvent, ...],
) -> PhotoAdded:
    """``registered``: image ids of the photos that this one placed; ``clock``: of its turn;
    ``events``: what became of models in it."""
    # Apart from the rest of mapping: it alone depends on how many photos came before.
    refinements = [event for event in events if isinstance(event, ModelRefined)]
    clock.move("map", "refine", sum(event.seconds for event in refinements))
    return PhotoAdded(
        name=photo.name,
        image_id=image_id,
        num_keypoints=len(photo.features),
        candidates=outcomes,
        registered=tuple(parts.catalog.name(i) for i in registered),
        num_registered=len(parts.atlas.registered),
        num_points=parts.atlas.num_points,
        seconds={**photo.seconds, **clock.seconds},
        events=events,
    )

"""What happens to a photo."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeAlias

from sfm_front.events.model_events import ModelEvent
from sfm_front.types import CandidateOutcome, Skipped, StoredPhoto, WaitingReason

# Stages of ``PhotoAdded.seconds`` that run ahead of a photo's turn, beside the mapping of others.
PREFETCHED_STAGES = frozenset({"read", "sift", "vlad", "network"})


@dataclass(frozen=True, slots=True)
class PhotoAdded:
    """A photo was matched and stored, and registered if it could be.

    ``candidates`` are ordered as re-ranked. ``registered`` names every photo that this step placed:
    this one, and waiting ones. ``num_registered`` and ``num_points`` are those of all models now.
    ``seconds`` is by stage; work done ahead counts too. ``events``: what became of the models.
    """

    name: str
    image_id: int
    num_keypoints: int = 0
    candidates: tuple[CandidateOutcome, ...] = ()
    registered: tuple[str, ...] = ()
    num_registered: int = 0
    num_points: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    events: tuple[ModelEvent, ...] = ()

    @classmethod
    def restored(cls, photo: StoredPhoto) -> PhotoAdded:
        """What is known of a photo of an earlier run; what its mapping took is not any more."""
        return cls(
            photo.name,
            photo.image_id,
            num_keypoints=photo.num_keypoints,
            candidates=photo.candidates,
            seconds=photo.seconds,
        )

    @property
    def most_relevant(self) -> str | None:
        """The first candidate; None if there was none."""
        return self.candidates[0].name if self.candidates else None

    @property
    def verified(self) -> tuple[str, ...]:
        """Candidates with a verified pair."""
        return tuple(candidate.name for candidate in self.candidates if candidate.verified)


@dataclass(frozen=True, slots=True)
class PhotoArrived:
    """A photo was noticed, and will be described."""

    name: str


@dataclass(frozen=True, slots=True)
class PhotoDescribed:
    """A photo has its features and its global vector, and its turn begins.

    ``seconds`` by stage, much of it beside the turns of earlier photos.
    """

    name: str
    num_keypoints: int
    seconds: dict[str, float]


@dataclass(frozen=True, slots=True)
class PhotoPlaced:
    """A photo was registered in a model.

    ``quaternion_xyzw`` and ``translation`` are those of cam_from_world; ``camera`` is COLMAP's
    model with its ``params``, in pixels of the file. ``num_inliers``: points of the model that
    the photo observes. ``latency_s``: from arrival, None for photos of an earlier run.
    """

    name: str
    image_id: int
    model_id: int
    quaternion_xyzw: tuple[float, float, float, float]
    translation: tuple[float, float, float]
    camera: str
    params: tuple[float, ...]
    num_inliers: int
    latency_s: float | None


@dataclass(frozen=True, slots=True)
class PhotoWaiting:
    """A photo was stored and fits no model yet, and why: ``reason`` in words, and its ``kind``."""

    name: str
    image_id: int
    reason: str
    kind: WaitingReason


PhotoEvent: TypeAlias = (
    PhotoArrived | Skipped | PhotoDescribed | PhotoAdded | PhotoPlaced | PhotoWaiting
)

"""What a session has told of its photos and models so far, event by event."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from enum import Enum
from typing import Any

import numpy as np
import pycolmap

from sfm_front.reports.event_words import in_words
from sfm_front.types import Float64Array, WaitingReason

# Lines of what became of models, for reading.
_MOST_LINES = 200
GIVEN_UP = "its model was given up"
"""Why a photo that was placed is in no model any more."""

# Verified pairs below which a photo counts as poorly connected, unless the session says otherwise.
_FEW_PAIRS = 3


class PhotoState(Enum):
    """Where a photo is on its way."""

    ARRIVED = "arrived"
    DESCRIBED = "being matched"
    WAITING = "waits"
    PLACED = "placed"
    SKIPPED = "not used"


@dataclass(frozen=True, slots=True, eq=False)
class PlacedPose:
    """Where a photo was when it was placed: ``cam_from_world`` in its model then; ``size`` (3,) of
    its frustum, half width, half height and depth, with a diagonal of 1 at the base."""

    model_id: int
    cam_from_world: pycolmap.Rigid3d
    size: Float64Array


@dataclass(slots=True, eq=False)
class PhotoStory:
    """One photo. ``links``: verified pairs, name → inliers; ``similar``: what retrieval proposed,
    best first. ``waiting``: of what kind the ``reason`` is, where that is known. ``time``: seconds
    since 1970 of the last event of its pose."""

    name: str
    state: PhotoState = PhotoState.ARRIVED
    image_id: int | None = None
    reason: str = ""
    waiting: WaitingReason | None = None
    num_keypoints: int = 0
    num_inliers: int = 0
    similar: tuple[str, ...] = ()
    links: dict[str, int] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    latency_s: float | None = None
    pose: PlacedPose | None = None
    time: float = 0.0


class Story:
    """Follows a session; events that are unknown or damaged are passed over."""

    def __init__(self) -> None:
        self.photos: dict[str, PhotoStory] = {}
        self.by_id: dict[int, PhotoStory] = {}
        self.newest: PhotoStory | None = None
        self.lines: list[tuple[float, str]] = []
        self.began: float | None = None
        self.last: float | None = None
        self.ended: bool | None = None
        # Photos that it has not taken, and what takes them.
        self.num_left = 0
        self.command = ""
        # Of its end, in words, once that has begun.
        self.step = ""
        self.num_points = 0
        self.few_pairs = _FEW_PAIRS
        # Model id → when its frame changed last, so that poses of before are elsewhere now.
        self.moved: dict[int, float] = {}

    def tell(self, event: Mapping[str, Any]) -> None:
        """Take in one line of ``events.jsonl``."""
        kind = event.get("event")
        hear = getattr(self, f"_on_{kind}", None) if isinstance(kind, str) else None
        try:
            self.last = datetime.fromisoformat(event["time"]).timestamp()
            if hear is not None:
                hear(event)
            words = in_words(event)
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError):
            return
        if words:
            self.lines = [*self.lines[1 - _MOST_LINES :], (self.last, words)]

    @property
    def is_unfinished(self) -> bool:
        """Whether there is a session that has not ended, or was stopped before its end."""
        return self.began is not None and not self.ended

    def in_state(self, state: PhotoState) -> list[PhotoStory]:
        """The photos of which this is the state, in order of arrival."""
        return [photo for photo in self.photos.values() if photo.state is state]

    def _photo(self, event: Mapping[str, Any]) -> PhotoStory:
        name = str(event["name"])
        photo = self.photos.setdefault(name, PhotoStory(name))
        if "image_id" in event:
            photo.image_id = int(event["image_id"])
            self.by_id[photo.image_id] = photo
        return photo

    def _on_session_started(self, event: Mapping[str, Any]) -> None:
        self.began, self.ended, self.step, self.num_left = self.last, None, "", 0
        self.command = str(event.get("command", ""))
        self.few_pairs = int(event["options"]["second_look"]["min_pairs"])

    def _on_finishing_began(self, event: Mapping[str, Any]) -> None:
        self.step = in_words(event)

    def _on_session_ended(self, event: Mapping[str, Any]) -> None:
        self.ended, self.num_left = bool(event["finished"]), int(event.get("num_left", 0))

    def _on_photo_arrived(self, event: Mapping[str, Any]) -> None:
        self._photo(event)

    def _on_photo_skipped(self, event: Mapping[str, Any]) -> None:
        photo = self._photo(event)
        photo.state = PhotoState.SKIPPED
        photo.reason = ": ".join(filter(None, (str(event["reason"]), str(event["detail"]))))

    def _on_photo_described(self, event: Mapping[str, Any]) -> None:
        photo = self._photo(event)
        photo.state, photo.num_keypoints = PhotoState.DESCRIBED, int(event["num_keypoints"])

    def _on_photo_added(self, event: Mapping[str, Any]) -> None:
        photo = self._photo(event)
        photo.num_keypoints = int(event["num_keypoints"])
        photo.seconds = {str(k): float(v) for k, v in event["seconds"].items()}
        photo.similar = tuple(str(one["name"]) for one in event["candidates"])
        self.num_points = int(event["num_points"])
        self.newest = photo
        for candidate in event["candidates"]:
            if candidate["verified"]:
                self._link(photo, self.photos.get(candidate["name"]), candidate["inliers"] or 0)

    def _on_photo_placed(self, event: Mapping[str, Any]) -> None:
        photo = self._photo(event)
        photo.state, photo.reason = PhotoState.PLACED, ""
        photo.num_inliers = int(event["num_inliers"])
        if event["latency_s"] is not None:
            photo.latency_s = float(event["latency_s"])
        quaternion, translation = np.array(event["quaternion_xyzw"]), np.array(event["translation"])
        photo.pose = PlacedPose(
            int(event["model_id"]),
            pycolmap.Rigid3d(pycolmap.Rotation3d(quaternion), translation),
            _size_of(event["camera"], event["params"]),
        )
        photo.time = self.last or 0.0

    def _on_photo_waiting(self, event: Mapping[str, Any]) -> None:
        photo = self._photo(event)
        photo.state, photo.reason = PhotoState.WAITING, str(event["reason"])
        photo.waiting = WaitingReason(event["kind"]) if "kind" in event else None

    def _on_looked_again(self, event: Mapping[str, Any]) -> None:
        photo = self.by_id[int(event["image_id"])]
        for image_id in event["found"]:
            self._link(photo, self.by_id.get(image_id), 0)

    def _on_models_joined(self, event: Mapping[str, Any]) -> None:
        self._move(event["joined_model_id"])

    def _on_georeferenced(self, event: Mapping[str, Any]) -> None:
        if event["state"] == "metric":
            self._move(event["model_id"])

    def _on_held_to_control_points(self, event: Mapping[str, Any]) -> None:
        self._move(event["model_id"])

    def _on_look_alikes_refused(self, event: Mapping[str, Any]) -> None:
        self._move(event["model_id"])

    def _on_model_dropped(self, event: Mapping[str, Any]) -> None:
        self._move(event["model_id"])

    def _move(self, model_id: int) -> None:
        self.moved[int(model_id)] = self.last or 0.0

    def _link(self, photo: PhotoStory, other: PhotoStory | None, inliers: int) -> None:
        if other is None or other is photo:
            return
        for one, two in ((photo, other), (other, photo)):
            one.links[two.name] = max(int(inliers), one.links.get(two.name, 0))


def _size_of(camera: str, params: list[float]) -> Float64Array:
    """By the principal point, which is in the middle of a photo or near it."""
    model = pycolmap.Camera(model=camera, width=2, height=2, params=params)
    size = np.array([model.principal_point_x, model.principal_point_y, model.mean_focal_length()])
    scaled: Float64Array = size / (2 * np.hypot(size[0], size[1]))
    return scaled

"""Tells listeners what happens in a session, with each photo's time from arrival to pose."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path

from sfm_front.events import (
    Event,
    FinishingBegan,
    FinishingStep,
    Listener,
    ModelEvent,
    ModelTurn,
    PhotoArrived,
    PhotoPlaced,
    PhotoWaiting,
)
from sfm_front.mapping.atlas import Atlas
from sfm_front.session.options import SessionOptions
from sfm_front.types import PhotoPath


class Announcer:
    """Hands each event to all listeners at once."""

    def __init__(self, listeners: Sequence[Listener], options: SessionOptions) -> None:
        self._steps = list(FinishingStep)
        if options.control_points.file is None:
            self._steps.remove(FinishingStep.CONTROL_POINTS)
        self._listeners = list(listeners)
        self._model_events: list[ModelEvent] = []
        self._paths: dict[str, Path] = {}
        self._arrived_s: dict[str, float] = {}
        self.latencies_s: list[float] = []

    def add_listener(self, listener: Listener) -> None:
        """It hears of everything from now on."""
        self._listeners.append(listener)

    def tell(self, event: Event) -> None:
        """An event of a photo or of the session."""
        for listener in self._listeners:
            listener(event)

    def begin(self, step: FinishingStep, turn: ModelTurn | None = None) -> None:
        """A step of the session's end begins, or in it the turn of a model."""
        self.tell(FinishingBegan(step, self._steps.index(step) + 1, len(self._steps), turn))

    def tell_of_model(self, event: ModelEvent) -> None:
        """An event of a model; it is kept for ``pop_model_events``, too."""
        self._model_events.append(event)
        self.tell(event)

    def pop_model_events(self) -> tuple[ModelEvent, ...]:
        """What became of models since the last call."""
        events, self._model_events = tuple(self._model_events), []
        return events

    def arrive(self, photo: PhotoPath) -> PhotoPath:
        """Note when a photo arrived; returns it."""
        self._paths[photo.name] = photo.path
        self._arrived_s[photo.name] = time.monotonic()
        self.tell(PhotoArrived(photo.name))
        return photo

    def path_of(self, name: str) -> Path:
        """Where a photo that arrived lies; its name if it did not pass ``arrive``."""
        return self._paths.pop(name, Path(name))

    def tell_outcome(self, atlas: Atlas, image_id: int, placed: Sequence[int]) -> None:
        """Photos that were placed when ``image_id`` was added, and whether it waits."""
        for placed_id in placed:
            self.tell_placed(atlas, placed_id)
        if image_id not in placed:
            name, why = atlas.view_graph.name(image_id), atlas.why_not_registered(image_id)
            self.tell(PhotoWaiting(name, image_id, str(why), why.reason))

    def tell_placed(self, atlas: Atlas, image_id: int) -> None:
        """A photo that is registered now and was not before."""
        model = atlas.model_of(image_id)
        image = model.reconstruction.image(image_id)
        camera, pose = model.reconstruction.camera(image.camera_id), image.cam_from_world()
        arrived_s = self._arrived_s.pop(image.name, None)
        latency_s = None if arrived_s is None else time.monotonic() - arrived_s
        if latency_s is not None:
            self.latencies_s.append(latency_s)
        self.tell(
            PhotoPlaced(
                name=image.name,
                image_id=image_id,
                model_id=model.model_id,
                quaternion_xyzw=tuple(pose.rotation.quat.tolist()),
                translation=tuple(pose.translation.tolist()),
                camera=camera.model.name,
                params=tuple(camera.params.tolist()),
                num_inliers=image.num_points3D,
                latency_s=latency_s,
            )
        )

"""Flights that meet late: two that a few photos join, and one that comes back to where it began."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.evaluation.poses import auc, pose_errors
from sfm_front.evaluation.synthetic.scene import SyntheticScene, as_described, make_scene
from sfm_front.events import DropReason, ModelDropped, ModelEvent, ModelsJoined, PhotoAdded
from sfm_front.features.global_descriptors.descriptor import resolve
from sfm_front.mapping.atlas import Atlas, AtlasOptions
from sfm_front.mapping.finishing import finish
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session
from sfm_front.storage.database import DATABASE, PhotoDatabase

# Photos of the round trip between two flights that nobody takes, but for the bridge photos: the
# last of the one and the first of the other have nothing in common.
_GAP = 8
_BRIDGES = (1, 2, 3, 4, 6)

Note = Callable[[PhotoAdded], None]


@dataclass(frozen=True, slots=True)
class Flown:
    """``seconds``: of each photo's turn; ``joined_at``: rows of the photos in whose turn two models
    became one, by a similarity or photo by photo. ``auc``: of the pose errors of all pairs, at 1, 3
    and 5 degrees, in [0, 1]."""

    seconds: tuple[float, ...]
    joined_at: tuple[int, ...]
    num_registered: int
    auc: tuple[float, ...]


def two_flights(
    photos_each: int,
    points_per_image: int,
    output: Path,
    options: SessionOptions,
    *,
    bridges_last: bool,
    seed: int,
    note: Note,
) -> Flown:
    """Two flights along one way with a gap between them, which five bridge photos close; these
    come last, or else in their place. Raises ConfigError for flights of fewer than 20 photos."""
    if photos_each < 20:
        raise ConfigError(f"a flight needs at least 20 photos, got {photos_each}")
    # A third of the round trip is left out, so that its ends do not meet.
    scene = make_scene(3 * photos_each, points_per_image, seed=seed, layout="ring")
    first, second = range(photos_each), range(photos_each + _GAP, 2 * photos_each + _GAP)
    bridges = [photos_each + place for place in _BRIDGES]
    order = [*first, *second, *bridges] if bridges_last else [*first, *bridges, *second]
    return _fly(scene, order, output, options, note)


def round_trip(
    num_photos: int,
    points_per_image: int,
    output: Path,
    options: SessionOptions,
    *,
    seed: int,
    note: Note,
) -> tuple[Flown, tuple[float, ...]]:
    """A flight whose last photos see what its first ones saw; and the AUC of a model that was grown
    from all its pairs at once."""
    scene = make_scene(num_photos, points_per_image, seed=seed, layout="ring")
    flown = _fly(scene, range(num_photos), output, options, note)
    models = grown_at_once(output / DATABASE, options.atlas)
    return flown, tuple(auc(pose_errors(scene.truth(), models)))


def grown_at_once(database: Path, options: AtlasOptions) -> list[pycolmap.Reconstruction]:
    """Finished models of a session's photos, grown when all its pairs were there."""
    view_graph = ViewGraph()
    with PhotoDatabase(database) as stored:
        cameras = stored.cameras()
        for photo in stored.photos():
            keypoints, _ = stored.keypoints(photo.image_id)
            pairs = stored.pairs(photo.image_id)
            camera = cameras[photo.camera_id]
            view_graph.add(photo.image_id, photo.name, camera, keypoints, pairs)
    atlas = Atlas(view_graph, options)
    # Without a model there is a restart, from the best pairs of all.
    finish(atlas)
    return [model.reconstruction for model in atlas.models]


def _fly(
    scene: SyntheticScene,
    order: Sequence[int],
    output: Path,
    options: SessionOptions,
    note: Note,
) -> Flown:
    descriptor, _ = resolve("vlad")
    seconds, joined_at = [], []
    with Session(output, options) as session:
        for row, index in enumerate(order):
            seen = scene.photo(index)
            vector = descriptor.describe(np.empty(0, np.uint8), seen.features)
            photo = as_described(seen, scene.camera, vector)
            started = perf_counter()
            added = session.add_extracted(photo)
            seconds.append(perf_counter() - started)
            assert isinstance(added, PhotoAdded)  # no two photos of the scene are copies
            if any(_became_one(event) for event in added.events):
                joined_at.append(row)
            note(added)
        models = [model.reconstruction for model in session.finish().models]
    truth = scene.truth()
    taken = {scene.name(index) for index in order}
    for image_id in truth.reg_image_ids():
        if truth.image(image_id).name not in taken:
            truth.deregister_frame(truth.image(image_id).frame_id)
    return Flown(
        seconds=tuple(seconds),
        joined_at=tuple(joined_at),
        num_registered=max((int(model.num_reg_images()) for model in models), default=0),
        auc=tuple(auc(pose_errors(truth, models))),
    )


def _became_one(event: ModelEvent) -> bool:
    if isinstance(event, ModelDropped):
        return event.reason is DropReason.COVERED
    return isinstance(event, ModelsJoined)

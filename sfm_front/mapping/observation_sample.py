"""Some observations of the photos of one camera, few enough to be computed with in numpy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.mapping.covisibility import IndexArray
from sfm_front.types import Float64Array

_MAX_PHOTOS = 50
_MAX_POINTS = 1500
# Points looked at for each that is wanted: not all are seen by enough of the photos.
_SURPLUS = 3
# A point that only two photos see says next to nothing: it lies where their rays meet.
_MIN_OBSERVERS = 3


@dataclass(frozen=True, eq=False)
class ObservationSample:
    """K observations of N points by M photos of one camera.

    ``rotations`` (M, 3, 3) and ``translations`` (M, 3): camera from world. ``points`` (N, 3): in
    world coordinates. ``pixels`` (K, 2): where photo ``photo`` (K,) has point ``point`` (K,).
    ``share``: how many of the photos' points these are, in (0, 1].
    """

    rotations: Float64Array
    translations: Float64Array
    points: Float64Array
    pixels: Float64Array
    photo: IndexArray
    point: IndexArray
    share: float

    @classmethod
    def of(cls, reconstruction: pycolmap.Reconstruction, camera_id: int) -> ObservationSample:
        """Of the photos of this camera that see most in common, in a model that has points; the
        same each time. It may be empty."""
        images = [
            image
            for image_id in sorted(reconstruction.reg_image_ids())
            if (image := reconstruction.image(image_id)).camera_id == camera_id
        ]
        rng = np.random.default_rng(0)
        looked_at, share = _chosen(
            np.array(sorted(reconstruction.point3D_ids()), np.int64),
            round(_MAX_POINTS * _SURPLUS * max(1.0, len(images) / _MAX_PHOTOS)),
            rng,
        )
        photo, point, keypoint = _observations(reconstruction, images, looked_at)
        if len(images) > _MAX_PHOTOS:
            kept = np.isin(photo, close_photos(photo, point, len(images), len(looked_at)))
            photo, point, keypoint = photo[kept], point[kept], keypoint[kept]
        observers = np.bincount(point, minlength=len(looked_at))
        chosen, part = _chosen(np.flatnonzero(observers >= _MIN_OBSERVERS), _MAX_POINTS, rng)
        kept = np.isin(point, chosen)
        used, photo = np.unique(photo[kept], return_inverse=True)
        seen, point = np.unique(point[kept], return_inverse=True)
        poses = [images[number].cam_from_world() for number in used]
        return cls(
            np.array([pose.rotation.matrix() for pose in poses]).reshape(-1, 3, 3),
            np.array([pose.translation for pose in poses]).reshape(-1, 3),
            np.array([reconstruction.point3D(i).xyz for i in looked_at[seen]]).reshape(-1, 3),
            np.array(
                [
                    images[used[i]].point2D(int(j)).xy
                    for i, j in zip(photo, keypoint[kept], strict=True)
                ],
                np.float64,
            ).reshape(-1, 2),
            photo,
            point,
            share * part,
        )


def _chosen(ids: IndexArray, at_most: int, rng: np.random.Generator) -> tuple[IndexArray, float]:
    """Some of the ids, sorted, and which share of them."""
    if len(ids) <= at_most:
        return ids, 1.0
    return np.sort(rng.choice(ids, at_most, replace=False)), at_most / len(ids)


def _observations(
    reconstruction: pycolmap.Reconstruction, images: Sequence[pycolmap.Image], point_ids: IndexArray
) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Photo, point and keypoint of each observation; photos and points by their place."""
    place = {image.image_id: number for number, image in enumerate(images)}
    # There are millions in a long flight: never a Python object for each at once.
    found = (
        number
        for index, point_id in enumerate(point_ids.tolist())
        for element in reconstruction.point3D(point_id).track.elements
        if (place_of := place.get(element.image_id)) is not None
        for number in (place_of, index, element.point2D_idx)
    )
    photo, point, keypoint = np.fromiter(found, np.int64).reshape(-1, 3).T
    return photo, point, keypoint


def close_photos(
    photo: IndexArray, point: IndexArray, num_photos: int, num_points: int
) -> list[int]:
    """The photo that sees most points and, up to 50 in all, those that share most with what is
    there, in that order.

    ``photo`` (K,) and ``point`` (K,): numbers below ``num_photos`` and ``num_points``, of each
    observation.
    """
    # Of a long flight, a matrix of all photos and points would take gigabytes.
    photo, point = np.divmod(np.unique(photo * num_points + point), num_points)
    ends = np.searchsorted(photo, np.arange(num_photos + 1))
    is_common = np.ones(num_points, np.bool_)
    chosen: list[int] = []
    while len(chosen) < _MAX_PHOTOS:
        shared = np.bincount(photo[is_common[point]], minlength=num_photos)
        shared[chosen] = -1
        best = int(np.argmax(shared))
        if shared[best] <= 0:
            break
        if not chosen:
            is_common[:] = False
        is_common[point[ends[best] : ends[best + 1]]] = True
        chosen.append(best)
    return chosen

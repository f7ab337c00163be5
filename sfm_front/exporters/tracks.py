"""Points and the keypoints that see them, for formats that list both."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.errors import InputError
from sfm_front.types import Float64Array

# What a refined principal point may be off without anybody noticing.
_CENTRED_PX = 0.5
_RADIAL = {"SIMPLE_PINHOLE": 0, "SIMPLE_RADIAL": 1, "RADIAL": 2}


@dataclass(frozen=True, slots=True, eq=False)
class ListedPoint:
    """``xyz`` (3,), ``color`` (3,), and its observations: the photo's place in the list, the
    keypoint's index, and x, y in pixels from the principal point, y down."""

    xyz: Float64Array
    color: tuple[int, int, int]
    views: tuple[tuple[int, int, float, float], ...]


def listed_images(model: pycolmap.Reconstruction) -> list[pycolmap.Image]:
    """The model's images by name: a photo's place in this list is its number."""
    return sorted(map(model.image, model.reg_image_ids()), key=lambda image: str(image.name))


def listed_points(
    model: pycolmap.Reconstruction, images: list[pycolmap.Image]
) -> Iterator[ListedPoint]:
    """The points of the model, by id."""
    numbers = {image.image_id: number for number, image in enumerate(images)}
    places = {
        image.image_id: _from_principal_point(image, model.camera(image.camera_id))
        for image in images
    }
    for point_id in sorted(model.point3D_ids()):
        point = model.point3D(point_id)
        yield ListedPoint(
            point.xyz,
            (int(point.color[0]), int(point.color[1]), int(point.color[2])),
            tuple(
                (numbers[e.image_id], e.point2D_idx, *places[e.image_id][e.point2D_idx])
                for e in point.track.elements
            ),
        )


def radial_terms(camera: pycolmap.Camera, target: str) -> tuple[float, float]:
    """k1 and k2 of a camera of one focal length, whose principal point is the photo's middle.

    Raises InputError for any other camera: that is all that ``target`` can hold.
    """
    hint = "export --to nerfstudio, gsplat or openmvs instead"
    if camera.model_name not in _RADIAL:
        raise InputError(
            f"camera {camera.camera_id}: {target} holds SIMPLE_RADIAL and RADIAL cameras only, not "
            f"{camera.model_name}; {hint}"
        )
    x, y = camera.principal_point_x, camera.principal_point_y
    off = max(abs(x - camera.width / 2), abs(y - camera.height / 2))
    if off > _CENTRED_PX:
        raise InputError(
            f"camera {camera.camera_id}: {target} takes the middle of a photo for its principal "
            f"point, which is {off:.1f} px off; {hint}"
        )
    count = _RADIAL[camera.model_name]
    terms = [float(term) for term in camera.params[3 : 3 + count]] + [0.0, 0.0]
    return terms[0], terms[1]


def _from_principal_point(
    image: pycolmap.Image, camera: pycolmap.Camera
) -> list[tuple[float, float]]:
    centre = np.array([camera.principal_point_x, camera.principal_point_y])
    points = np.array([point.xy for point in image.points2D]).reshape(-1, 2) - centre
    return [(float(x), float(y)) for x, y in points]

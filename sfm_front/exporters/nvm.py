"""A model as VisualSFM's NVM_V3 file.

Conventions: ccwu.me/vsfm/doc.html and ``LoadNVM`` of Multicore Bundle Adjustment. A camera is its
focal length, the quaternion (w, x, y, z) into it, its centre, and one radial term r, which
*undistorts*: a measurement m, from the middle of the photo with y down, belongs to the direction
m (1 + r |m|² / f²) / f. COLMAP's k1 distorts, so that r is -k1 in first order.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pycolmap

from sfm_front.exporters.photo_files import IMAGES, place_photos
from sfm_front.exporters.scene import Job
from sfm_front.exporters.tracks import listed_images, listed_points, radial_terms
from sfm_front.exporters.undistortion import Projection

MODEL = "model.nvm"

_NUM_RADII = 200
_NOTED_PX = 0.5


def write(job: Job) -> list[str]:
    """``model.nvm``, and ``images/`` with the photos as they were taken.

    Raises InputError for cameras that NVM cannot hold: see ``radial_terms``. Says if the one radial
    term leaves more than half a pixel.
    """
    model = job.scene.model
    for image_id in model.reg_image_ids():
        radial_terms(model.camera(model.image(image_id).camera_id), "NVM")
    notes = place_photos(job, Projection.AS_TAKEN)
    images = listed_images(model)
    undistorting = {
        camera_id: undistorting_term(model.camera(camera_id))
        for camera_id in sorted({image.camera_id for image in images})
    }
    with (job.folder / MODEL).open("w", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in _lines(model, images, undistorting))
    worst = max(error for _, error in undistorting.values())
    if worst > _NOTED_PX:
        notes.append(
            f"NVM's one radial term is up to {worst:.1f} px off in the corners; "
            "--to bundler holds this lens exactly"
        )
    return notes


def undistorting_term(camera: pycolmap.Camera) -> tuple[float, float]:
    """VisualSFM's r that suits k1 and k2 best, and the pixels it is off at the worst.

    Least squares over the directions of a photo's pixels, each ring as often as it has pixels.
    """
    focal = camera.mean_focal_length()
    distorted = np.linspace(0, np.hypot(camera.width, camera.height) / 2 / focal, _NUM_RADII)
    # By COLMAP's own inverse; the ring's direction does not matter.
    pixels = np.column_stack([distorted * focal, np.zeros(_NUM_RADII)])
    pixels += [camera.principal_point_x, camera.principal_point_y]
    straight = np.linalg.norm(np.asarray(camera.cam_from_img(pixels)), axis=1)
    has_direction = np.isfinite(straight)
    distorted, straight = distorted[has_direction], straight[has_direction]
    cubes, missing = distorted**3, straight - distorted
    term = float((distorted * cubes * missing).sum() / (distorted * cubes**2).sum())
    return term, float(np.abs(term * cubes - missing).max() * focal)


def _lines(
    model: pycolmap.Reconstruction,
    images: list[pycolmap.Image],
    undistorting: dict[int, tuple[float, float]],
) -> Iterator[str]:
    yield from ("NVM_V3", "", str(len(images)))
    for image in images:
        x, y, z, w = image.cam_from_world().rotation.quat
        term, _ = undistorting[image.camera_id]
        focal = model.camera(image.camera_id).mean_focal_length()
        numbers = [focal, w, x, y, z, *image.projection_center(), term]
        yield " ".join([f"{IMAGES}/{image.name}", *(repr(float(n)) for n in numbers), "0"])
    yield from ("", str(model.num_points3D()))
    for point in listed_points(model, images):
        views = (f"{photo} {key} {x!r} {y!r}" for photo, key, x, y in point.views)
        place = (repr(float(number)) for number in point.xyz)
        yield " ".join([*place, *map(str, point.color), str(len(point.views)), *views])
    # No further models, and no PLY files.
    yield from ("", "0", "", "#the last part of NVM file points to the PLY files", "0")

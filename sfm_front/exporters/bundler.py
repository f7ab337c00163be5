"""A model as Bundler v0.3 wrote it: ``bundle.out`` and ``list.txt``.

Conventions: the manual of Bundler v0.4 (cs.cornell.edu/~snavely/bundler). Its camera looks along
-z with y up; keypoints are measured from the middle of the photo, x right and y up; a point P goes
to f r(p) p with p = -P / P_z and r(p) = 1 + k1 |p|² + k2 |p|⁴.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pycolmap

from sfm_front.exporters.photo_files import IMAGES, place_photos
from sfm_front.exporters.scene import Job
from sfm_front.exporters.tracks import listed_images, listed_points, radial_terms
from sfm_front.exporters.undistortion import Projection
from sfm_front.types import Float64Array

BUNDLE, LIST = "bundle.out", "list.txt"

_BUNDLER_FROM_COLMAP = np.diag([1.0, -1.0, -1.0])


def write(job: Job) -> list[str]:
    """``bundle.out``, ``list.txt``, and ``images/`` with the photos as they were taken.

    Raises InputError for cameras that Bundler cannot hold: see ``radial_terms``.
    """
    model = job.scene.model
    for image_id in model.reg_image_ids():
        radial_terms(model.camera(model.image(image_id).camera_id), "Bundler")
    notes = place_photos(job, Projection.AS_TAKEN)
    images = listed_images(model)
    (job.folder / LIST).write_text(
        "".join(f"{IMAGES}/{image.name}\n" for image in images), encoding="utf-8"
    )
    with (job.folder / BUNDLE).open("w", encoding="ascii") as file:
        file.writelines(f"{line}\n" for line in _lines(model, images))
    return notes


def _lines(model: pycolmap.Reconstruction, images: list[pycolmap.Image]) -> Iterator[str]:
    yield "# Bundle file v0.3"
    yield f"{len(images)} {model.num_points3D()}"
    for image in images:
        camera = model.camera(image.camera_id)
        k1, k2 = radial_terms(camera, "Bundler")
        yield _numbers(np.array([camera.mean_focal_length(), k1, k2]))
        pose = _BUNDLER_FROM_COLMAP @ image.cam_from_world().matrix()
        yield from map(_numbers, pose[:, :3])
        yield _numbers(pose[:, 3])
    for point in listed_points(model, images):
        yield _numbers(point.xyz)
        yield " ".join(map(str, point.color))
        views = (f"{photo} {key} {x!r} {-y!r}" for photo, key, x, y in point.views)
        yield " ".join([str(len(point.views)), *views])


def _numbers(values: Float64Array) -> str:
    return " ".join(repr(float(value)) for value in values)

"""A scene for 3D Gaussian splatting as Inria's code reads it.

Conventions: ``scene/dataset_readers.py`` of graphdeco-inria/gaussian-splatting. It takes PINHOLE
cameras alone, reads ``sparse/0``, passes over the principal point, and finds photos by the last
part of their names.
"""

from __future__ import annotations

from sfm_front.exporters.colmap import POINT_CLOUD, check_written
from sfm_front.exporters.photo_files import place_photos
from sfm_front.exporters.ply import write_point_cloud
from sfm_front.exporters.scene import Job
from sfm_front.exporters.undistortion import Projection


def write(job: Job) -> list[str]:
    """``images/``: undistorted, cropped so that the principal point is their middle; ``sparse/0``:
    the model in COLMAP's binary form, with a PLY that has normals."""
    notes = place_photos(job, Projection.CENTRED_PINHOLE)
    sparse = job.folder / "sparse" / "0"
    sparse.mkdir(parents=True)
    job.scene.model.write_binary(sparse)
    check_written(job.scene.model, sparse)
    write_point_cloud(job.scene.model, sparse / POINT_CLOUD, normals=True)
    return notes

"""A scene as gsplat's examples read it.

Conventions: ``examples/datasets/colmap.py`` of nerfstudio-project/gsplat. It pairs the files of
``images/`` with the model's by their order, and applies the last camera's type to all.
"""

from __future__ import annotations

from sfm_front.exporters.colmap import check_written
from sfm_front.exporters.photo_files import place_photos
from sfm_front.exporters.scene import Job
from sfm_front.exporters.undistortion import Projection


def write(job: Job) -> list[str]:
    """``images/``: exactly the model's photos, undistorted; ``sparse/0``: the model in COLMAP's
    binary form, all cameras PINHOLE."""
    notes = place_photos(job, Projection.PINHOLE)
    sparse = job.folder / "sparse" / "0"
    sparse.mkdir(parents=True)
    job.scene.model.write_binary(sparse)
    check_written(job.scene.model, sparse)
    return notes

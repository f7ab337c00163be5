"""A scene as OpenMVS's InterfaceCOLMAP reads it: ``images/`` and text files in ``sparse/``.

Conventions: ``apps/InterfaceCOLMAP/InterfaceCOLMAP.cpp`` of cdcseacave/openMVS. It stops at the
first camera that is not PINHOLE, and crashes at a photo of a camera it has not read.
"""

from __future__ import annotations

from sfm_front.exporters.colmap import check_written
from sfm_front.exporters.photo_files import place_photos
from sfm_front.exporters.scene import Job
from sfm_front.exporters.undistortion import Projection


def write(job: Job) -> list[str]:
    """``images/``: undistorted; ``sparse/``: the model as text, all cameras PINHOLE."""
    notes = place_photos(job, Projection.PINHOLE)
    sparse = job.folder / "sparse"
    sparse.mkdir()
    job.scene.model.write_text(sparse)
    check_written(job.scene.model, sparse, binary=False)
    return notes

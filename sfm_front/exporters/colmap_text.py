"""A model as COLMAP's text files."""

from __future__ import annotations

from sfm_front.errors import InputError
from sfm_front.exporters.colmap import check_written, first_name_lost_in_text
from sfm_front.exporters.scene import Job


def write(job: Job) -> list[str]:
    """``cameras.txt``, ``images.txt``, ``points3D.txt``, ``frames.txt`` and ``rigs.txt``.

    Cameras, names and coordinates are those of the model. Raises InputError if a name has a white
    space, at which COLMAP would cut it.
    """
    model = job.scene.model
    lost = first_name_lost_in_text(model.image(i).name for i in model.reg_image_ids())
    if lost is not None:
        raise InputError(
            f"{lost!r}: COLMAP's text form cuts a name at its white space; rename the photo and "
            "reconstruct anew, or export --to openmvs or nerfstudio, which rename it"
        )
    model.write_text(job.folder)
    check_written(model, job.folder, binary=False)
    return []

"""A camera that stays as EXIF has it until its photos determine it."""

from __future__ import annotations

import pycolmap

from sfm_front.mapping.calibration import CalibrationOptions, photos_by_camera
from sfm_front.mapping.lens_evidence import LensEvidence
from sfm_front.mapping.lens_growth import FREE

# Two photos fit nearly any focal length.
_MIN_PHOTOS = 3


class HeldCamera:
    """Whether a model that grows adjusts its camera (TUNING: held-camera).

    ``ids``: cameras that stay as they are. Only one that all photos of the model share is held: of
    several, each is told by the points that the others place. One without a focal length from EXIF
    or a calibration has nothing to be held at. Once determined, a camera stays free.
    """

    def __init__(self, options: CalibrationOptions, *, is_determined: bool) -> None:
        self._options = options
        self.is_determined = is_determined
        self.ids: set[int] = set()

    def look_at(
        self, reconstruction: pycolmap.Reconstruction, first: dict[int, pycolmap.Camera]
    ) -> None:
        """After an adjustment. ``first``: cameras as photos came with them, by id."""
        photos = photos_by_camera(reconstruction)
        self.ids = set()
        if self.is_determined or len(photos) != 1:
            return
        ((camera_id, image_ids),) = photos.items()
        lens = FREE.get(reconstruction.camera(camera_id).model_name)
        if lens is None or not first[camera_id].has_prior_focal_length:
            return
        if len(image_ids) >= _MIN_PHOTOS:
            evidence = LensEvidence.of(reconstruction, camera_id)
            sigma = evidence.focal_sigma(lens) if evidence else float("inf")
            self.is_determined = sigma <= self._options.max_focal_sigma
        if not self.is_determined:
            self.ids = {camera_id}

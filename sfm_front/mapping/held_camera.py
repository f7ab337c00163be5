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

    def hold(
        self, reconstruction: pycolmap.Reconstruction, first: dict[int, pycolmap.Camera]
    ) -> None:
        """Unless it is determined. ``first``: cameras as photos came with them, by id."""
        cameras = {} if self.is_determined else photos_by_camera(reconstruction)
        self.ids = {
            camera_id
            for camera_id in cameras
            if len(cameras) == 1
            and first[camera_id].has_prior_focal_length
            and reconstruction.camera(camera_id).model_name in FREE
        }

    def look_at(
        self, reconstruction: pycolmap.Reconstruction, first: dict[int, pycolmap.Camera]
    ) -> None:
        """The same after an adjustment, by which it may be determined."""
        self.hold(reconstruction, first)
        if not self.ids or reconstruction.num_reg_images() < _MIN_PHOTOS:
            return
        (camera_id,) = self.ids
        evidence = LensEvidence.of(reconstruction, camera_id)
        if evidence is None:
            return
        sigma = evidence.focal_sigma(FREE[reconstruction.camera(camera_id).model_name])
        if sigma <= self._options.max_focal_sigma:
            self.is_determined, self.ids = True, set()

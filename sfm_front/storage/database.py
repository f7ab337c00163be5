"""The COLMAP database of a session."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pycolmap

from sfm_front.geometry.trivial_rigs import trivial_frame, trivial_rig
from sfm_front.runtime.closeable import Closeable
from sfm_front.types import ExtractedPhoto, GeoPosition, PairGeometry


class PhotoDatabase(Closeable):
    """Writes photos to a COLMAP database that COLMAP's own tools can go on with."""

    def __init__(self, path: Path) -> None:
        """Open the database at ``path``, or make it."""
        self._database = pycolmap.Database.open(path)

    def write(
        self,
        image_id: int,
        photo: ExtractedPhoto,
        camera: pycolmap.Camera,
        pairs: Sequence[PairGeometry],
    ) -> None:
        """Write a photo with all that is known of it, in one transaction.

        Ids are those given: frames have their image's id, rigs their camera's.
        """
        database = self._database
        with pycolmap.DatabaseTransaction(database):
            if not database.exists_camera(camera.camera_id):
                database.write_camera(camera, use_camera_id=True)
                database.write_rig(trivial_rig(camera), use_rig_id=True)
            image = pycolmap.Image(name=photo.name, camera_id=camera.camera_id, image_id=image_id)
            database.write_image(image, use_image_id=True)
            database.write_frame(trivial_frame(image), use_frame_id=True)
            database.write_keypoints(image_id, photo.features.keypoints)
            database.write_descriptors(
                image_id,
                pycolmap.FeatureDescriptors(
                    type=pycolmap.FeatureExtractorType.SIFT, data=photo.features.descriptors
                ),
            )
            if photo.exif.position is not None:
                database.write_pose_prior(_pose_prior(image, photo.exif.position))
            for pair in pairs:
                ids = pair.image_id1, pair.image_id2
                database.write_matches(*ids, pair.matches)
                database.write_two_view_geometry(*ids, pair.two_view_geometry)

    def close(self) -> None:
        self._database.close()


def _pose_prior(image: pycolmap.Image, position: GeoPosition) -> pycolmap.PosePrior:
    """COLMAP's WGS84 prior: latitude and longitude in degrees, altitude in metres."""
    prior = pycolmap.PosePrior()
    prior.corr_data_id = image.data_id
    prior.coordinate_system = pycolmap.PosePriorCoordinateSystem.WGS84
    altitude_m = np.nan if position.altitude_m is None else position.altitude_m
    prior.position = np.array([position.latitude_deg, position.longitude_deg, altitude_m])
    return prior

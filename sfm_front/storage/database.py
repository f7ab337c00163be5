"""The COLMAP database of a session."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pycolmap

from sfm_front.geometry.trivial_rigs import trivial_frame, trivial_rig
from sfm_front.runtime.closeable import Closeable
from sfm_front.types import ExtractedPhoto, GeoPosition, PairGeometry


class PhotoDatabase(Closeable):
    """Writes photos to a database that COLMAP's own tools can read and extend."""

    def __init__(self, path: Path) -> None:
        """Open the database at ``path``, or create it."""
        self._path = path
        self._database = pycolmap.Database.open(path)

    def write(
        self,
        image_id: int,
        photo: ExtractedPhoto,
        camera: pycolmap.Camera,
        pairs: Sequence[PairGeometry],
    ) -> None:
        """Write a photo, its camera and its pairs; if this raises, no row of the photo remains.

        Ids are those given. A frame has its image's id, a rig its camera's.
        """
        try:
            self._write(image_id, photo, camera, pairs)
        except BaseException:
            # pycolmap's transaction commits even then: COLMAP's database has no rollback.
            _remove(self._path, image_id)
            raise

    def _write(
        self,
        image_id: int,
        photo: ExtractedPhoto,
        camera: pycolmap.Camera,
        pairs: Sequence[PairGeometry],
    ) -> None:
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
            position = photo.exif.position
            if position is not None and position.altitude_m is not None:
                database.write_pose_prior(_pose_prior(image, position, position.altitude_m))
            for pair in pairs:
                ids = pair.image_id1, pair.image_id2
                database.write_matches(*ids, pair.matches)
                database.write_two_view_geometry(*ids, pair.two_view_geometry)

    def close(self) -> None:
        self._database.close()


def _remove(path: Path, image_id: int) -> None:
    """Remove the rows of a photo and its pairs. Its camera stays: others may share it."""
    with closing(sqlite3.connect(path)) as connection, connection:
        others = [row[0] for row in connection.execute("SELECT image_id FROM images")]
        pairs = [(pycolmap.image_pair_to_pair_id(image_id, other),) for other in others]
        for table in ("matches", "two_view_geometries"):
            connection.executemany(f"DELETE FROM {table} WHERE pair_id = ?", pairs)
        for table in ("keypoints", "descriptors", "images"):
            connection.execute(f"DELETE FROM {table} WHERE image_id = ?", (image_id,))
        for table in ("frame_data", "frames"):
            connection.execute(f"DELETE FROM {table} WHERE frame_id = ?", (image_id,))
        connection.execute("DELETE FROM pose_priors WHERE corr_data_id = ?", (image_id,))


def _pose_prior(
    image: pycolmap.Image, position: GeoPosition, altitude_m: float
) -> pycolmap.PosePrior:
    """COLMAP's WGS84 prior: latitude and longitude in degrees, altitude in metres.

    Positions without altitude get no prior: a NaN in the first prior makes COLMAP turn all of them
    into NaN.
    """
    prior = pycolmap.PosePrior()
    prior.corr_data_id = image.data_id
    prior.coordinate_system = pycolmap.PosePriorCoordinateSystem.WGS84
    prior.position = np.array([position.latitude_deg, position.longitude_deg, altitude_m])
    return prior

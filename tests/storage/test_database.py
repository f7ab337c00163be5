"""The COLMAP database: what is written is what pycolmap reads back."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from helpers.locations import ROOT, TESTS
from helpers.photo_stream import described, true_pair

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import Exif, GeoPosition

ROTATION_TOLERANCE = 1e-9


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(12, 200, seed=2, layout="orbit")


@pytest.fixture
def database(orbit, tmp_path):
    """Three photos: 1 and 2 of one camera, 3 with a position and of another; pairs 2-1 and 3-1."""
    file = tmp_path / "database.db"
    params = [300, 310, 200, 150, 0.1, 0, 0, 0]
    other = pycolmap.Camera(camera_id=5, model="OPENCV", width=400, height=300, params=params)
    other.has_prior_focal_length = True
    position = GeoPosition(47.5, -8.25, 512.0)
    with PhotoDatabase(file) as store:
        store.write(1, described(orbit, 0), orbit.camera, [])
        store.write(2, described(orbit, 1), orbit.camera, [true_pair(orbit, 1, 0, (2, 1))])
        photo = replace(described(orbit, 2, prefix="süd flug/"), exif=Exif(position=position))
        store.write(3, photo, other, [true_pair(orbit, 2, 0, (3, 1))])
    opened = pycolmap.Database.open(file)
    yield opened
    opened.close()


def test_cameras_rigs_and_frames(orbit, database):
    cameras = {camera.camera_id: camera for camera in database.read_all_cameras()}
    assert set(cameras) == {1, 5}
    assert cameras[1].model == pycolmap.CameraModelId.SIMPLE_RADIAL
    np.testing.assert_array_equal(cameras[1].params, orbit.camera.params)
    assert not cameras[1].has_prior_focal_length
    assert cameras[5].has_prior_focal_length
    assert (cameras[5].width, cameras[5].height) == (400, 300)
    assert {rig.rig_id: rig.ref_sensor_id.id for rig in database.read_all_rigs()} == {1: 1, 5: 5}
    frames = {frame.frame_id: frame for frame in database.read_all_frames()}
    assert {i: frame.rig_id for i, frame in frames.items()} == {1: 1, 2: 1, 3: 5}
    assert [data.id for data in frames[2].data_ids] == [2]


def test_images(database):
    images = {image.image_id: image for image in database.read_all_images()}
    assert {i: (image.name, image.camera_id, image.frame_id) for i, image in images.items()} == {
        1: ("000000.jpg", 1, 1),
        2: ("000001.jpg", 1, 2),
        3: ("süd flug/000002.jpg", 5, 3),
    }
    assert database.read_image_with_name("süd flug/000002.jpg").image_id == 3


def test_features(orbit, database):
    for image_id in (1, 2, 3):
        features = orbit.photo(image_id - 1).features
        keypoints = database.read_keypoints(image_id)
        assert keypoints.shape[1] in (4, 6)
        np.testing.assert_array_equal(keypoints[:, :2], features.keypoints[:, :2])
        stored = database.read_descriptors(image_id)
        assert stored.type == pycolmap.FeatureExtractorType.SIFT
        np.testing.assert_array_equal(stored.data, features.descriptors)


def test_scale_and_orientation_survive(orbit, database):
    keypoints = database.read_keypoints(1)
    expected = orbit.photo(0).features.keypoints
    if keypoints.shape[1] == 6:
        # COLMAP's affine form: scale and rotation as a matrix.
        keypoints = np.column_stack(
            [
                keypoints[:, :2],
                np.hypot(keypoints[:, 2], keypoints[:, 4]),
                np.arctan2(keypoints[:, 4], keypoints[:, 2]),
            ]
        )
    np.testing.assert_allclose(keypoints, expected, rtol=1e-5, atol=1e-5)


def test_matches_and_two_view_geometries(orbit, database):
    assert database.num_matched_image_pairs() == 2
    assert database.num_verified_image_pairs() == 2
    for later, earlier in ((2, 1), (3, 1)):
        pair = true_pair(orbit, later - 1, earlier - 1, (later, earlier))
        np.testing.assert_array_equal(database.read_matches(later, earlier), pair.matches)
        read = database.read_two_view_geometry(later, earlier)
        written = pair.two_view_geometry
        assert read.config == written.config
        np.testing.assert_array_equal(read.inlier_matches, written.inlier_matches)
        np.testing.assert_allclose(read.E, written.E, atol=ROTATION_TOLERANCE)
        np.testing.assert_allclose(
            read.cam2_from_cam1.matrix(), written.cam2_from_cam1.matrix(), atol=ROTATION_TOLERANCE
        )
        # Read the other way round, columns and pose are turned round.
        turned = database.read_two_view_geometry(earlier, later)
        np.testing.assert_array_equal(turned.inlier_matches, written.inlier_matches[:, ::-1])


def test_gps_is_a_wgs84_prior_of_its_photo_alone(database):
    (prior,) = database.read_all_pose_priors()
    assert prior.corr_data_id.id == 3
    assert prior.coordinate_system == pycolmap.PosePriorCoordinateSystem.WGS84
    np.testing.assert_array_equal(prior.position.ravel(), [47.5, -8.25, 512.0])


def test_a_position_without_altitude_spoils_no_other(orbit, tmp_path):
    """COLMAP would turn all priors into NaN if the first had no altitude."""
    positions = [GeoPosition(10.0, 20.0), GeoPosition(10.0, 20.0, 30.0)]
    with PhotoDatabase(tmp_path / "database.db") as database:
        for image_id, position in enumerate(positions, 1):
            photo = replace(described(orbit, image_id - 1), exif=Exif(position=position))
            database.write(image_id, photo, orbit.camera, [])
    with pycolmap.Database.open(tmp_path / "database.db") as opened:
        (prior,) = opened.read_all_pose_priors()
    assert prior.position.ravel().tolist() == [10.0, 20.0, 30.0]


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_a_write_that_fails_leaves_nothing_of_the_photo(orbit, tmp_path, error):
    file = tmp_path / "database.db"

    def pairs():
        yield true_pair(orbit, 1, 0, (2, 1))
        raise error

    with PhotoDatabase(file) as database:
        database.write(1, described(orbit, 0), orbit.camera, [])
        with pytest.raises(error):
            database.write(2, described(orbit, 1), orbit.camera, pairs())
        with closing(sqlite3.connect(file)) as rows:
            left = {
                table: rows.execute(f"SELECT count(*) FROM {table}").fetchone()[0]
                for table in (*EACH_PHOTO, "matches", "two_view_geometries")
            }
        assert left == {table: table in EACH_PHOTO for table in left}
        # The same photo can be written again.
        database.write(2, described(orbit, 1), orbit.camera, [true_pair(orbit, 1, 0, (2, 1))])
    with pycolmap.Database.open(file) as opened:
        assert opened.num_images() == 2
        assert opened.num_verified_image_pairs() == 1


EACH_PHOTO = ("images", "frames", "frame_data", "keypoints", "descriptors")

KILLED_WHILE_WRITING = """
import os, sys
from pathlib import Path
from helpers.photo_stream import described, true_pair
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.storage.database import PhotoDatabase

def pairs():
    yield true_pair(orbit, 1, 0, (2, 1))
    os._exit(9)

orbit = make_scene(12, 200, seed=2, layout="orbit")
store = PhotoDatabase(Path(sys.argv[1]))
store.write(1, described(orbit, 0), orbit.camera, [])
store.write(2, described(orbit, 1), orbit.camera, pairs())
"""


def test_a_killed_process_leaves_whole_photos(orbit, tmp_path):
    """The second photo's first pair is written, and the process dies before the next."""
    file = tmp_path / "database.db"
    path = os.pathsep.join([str(TESTS), str(ROOT)])
    killed = subprocess.run(
        [sys.executable, "-c", KILLED_WHILE_WRITING, str(file)],
        env=os.environ | {"PYTHONPATH": path},
        check=False,
    )
    assert killed.returncode == 9
    with pycolmap.Database.open(file) as database:
        assert [image.image_id for image in database.read_all_images()] == [1]
        assert database.num_frames() == 1
        assert database.num_keypoints() == len(orbit.photo(0).features)
        assert database.num_matched_image_pairs() == 0
    # What is left can be gone on with.
    with PhotoDatabase(file) as store:
        store.write(2, described(orbit, 1), orbit.camera, [true_pair(orbit, 1, 0, (2, 1))])
    with pycolmap.Database.open(file) as database:
        assert database.num_images() == 2
        assert database.num_verified_image_pairs() == 1


def test_a_photo_is_there_for_others_as_soon_as_it_is_written(orbit, tmp_path):
    with PhotoDatabase(tmp_path / "database.db") as store:
        for image_id in (1, 2):
            store.write(image_id, described(orbit, image_id - 1), orbit.camera, [])
            with pycolmap.Database.open(tmp_path / "database.db") as database:
                assert database.num_images() == image_id

"""The COLMAP database: what is written is what pycolmap reads back."""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from datetime import datetime

import numpy as np
import pycolmap
import pytest
from helpers.locations import ROOT, TESTS
from helpers.photo_stream import described, true_pair

from sfm_front.errors import StorageError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.geometry.trivial_rigs import trivial_frame, trivial_rig
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import (
    CandidateOutcome,
    Exif,
    FileState,
    GeoPosition,
    Rejected,
    Rejection,
    Skipped,
    SkipReason,
)

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
    prior = GeoPosition(47.5, -8.25, 512.0, 2.0, 5.0)
    with PhotoDatabase(file) as store:
        store.write(1, described(orbit, 0), orbit.camera, [])
        store.write(2, described(orbit, 1), orbit.camera, [true_pair(orbit, 1, 0, (2, 1))])
        photo = described(orbit, 2, prefix="süd flug/")
        store.write(3, photo, other, [true_pair(orbit, 2, 0, (3, 1))], prior=prior)
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


def test_a_prior_has_the_variances_of_its_position(database):
    (prior,) = database.read_all_pose_priors()
    np.testing.assert_array_equal(prior.position_covariance, np.diag([4.0, 4.0, 25.0]))


def test_pairs_may_come_after_their_photos(orbit, tmp_path):
    """They are read back after those that came with the photo."""
    with PhotoDatabase(tmp_path / "database.db") as database:
        for image_id in (1, 2):
            database.write(image_id, described(orbit, image_id - 1), orbit.camera, [])
        pairs = [true_pair(orbit, 2, other, (3, other + 1)) for other in (1, 0)]
        database.write(3, described(orbit, 2), orbit.camera, pairs[:1])
        database.write_pairs(pairs[1:])
        assert [pair.image_id2 for pair in database.pairs(3)] == [2, 1]
    with pycolmap.Database.open(tmp_path / "database.db") as opened:
        read = opened.read_two_view_geometry(3, 1)
    np.testing.assert_array_equal(read.inlier_matches, pairs[1].matches)


def test_pairs_may_lose_matches_that_were_refused(orbit, tmp_path):
    file = tmp_path / "database.db"
    first, second = (true_pair(orbit, 2, other, (3, other + 1)) for other in (0, 1))
    left = second.two_view_geometry.inlier_matches[::2]
    with PhotoDatabase(file) as database:
        for image_id in (1, 2):
            database.write(image_id, described(orbit, image_id - 1), orbit.camera, [])
        database.write(3, described(orbit, 2), orbit.camera, [first, second])
        database.keep_matches({(3, 1): left[:0], (3, 2): left})
        (pair,) = database.pairs(3)
        assert pair.image_id2 == 2
        np.testing.assert_array_equal(pair.two_view_geometry.inlier_matches, left)
        np.testing.assert_array_equal(pair.matches, second.matches)
    with pycolmap.Database.open(file) as opened:
        assert not opened.exists_two_view_geometry(3, 1)
        read = opened.read_two_view_geometry(3, 2)
        np.testing.assert_array_equal(read.inlier_matches, left)
        np.testing.assert_allclose(read.E, second.two_view_geometry.E, atol=ROTATION_TOLERANCE)


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
from sfm_front.errors import StorageError
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.geometry.trivial_rigs import trivial_frame, trivial_rig
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


READ_BY_ANOTHER = """
import sys, zlib, pycolmap
with pycolmap.Database.open(sys.argv[1]) as database:
    print(database.num_images())
"""


def test_a_photo_is_there_for_other_processes_as_soon_as_it_is_written(orbit, tmp_path):
    file = tmp_path / "database.db"
    with PhotoDatabase(file) as store:
        for image_id in (1, 2):
            store.write(image_id, described(orbit, image_id - 1), orbit.camera, [])
            reader = [sys.executable, "-c", READ_BY_ANOTHER, str(file)]
            read = subprocess.run(reader, capture_output=True, text=True, check=True)
            assert int(read.stdout) == image_id
    with pycolmap.Database.open(file) as database:
        assert database.num_images() == 2


def rows_of(file) -> dict[str, list[tuple[object, ...]]]:
    tables = (*EACH_PHOTO, "cameras", "rigs", "pose_priors", "matches", "two_view_geometries")
    with closing(sqlite3.connect(file)) as rows:
        return {table: rows.execute(f"SELECT * FROM {table}").fetchall() for table in tables}


def test_rows_are_those_that_pycolmap_writes(orbit, tmp_path):
    """To the bit, in every table and column: COLMAP's format is COLMAP's to define."""
    position = GeoPosition(47.5, -8.25, 512.0, 0.5, 2.0)
    photos = [described(orbit, index) for index in range(3)]
    camera = orbit.camera
    pairs = {2: [true_pair(orbit, 1, 0, (2, 1))], 3: [true_pair(orbit, 2, 1, (3, 2))]}
    matrix = np.arange(9.0).reshape(3, 3) + np.eye(3)
    pairs[3][0].two_view_geometry.F = pairs[3][0].two_view_geometry.H = matrix
    with PhotoDatabase(tmp_path / "ours.db") as store:
        for image_id, photo in enumerate(photos, 1):
            store.write(image_id, photo, camera, pairs.get(image_id, []), prior=position)
    with pycolmap.Database.open(tmp_path / "theirs.db") as database:
        database.write_camera(camera, use_camera_id=True)
        database.write_rig(trivial_rig(camera), use_rig_id=True)
        for image_id, photo in enumerate(photos, 1):
            image = pycolmap.Image(name=photo.name, camera_id=1, image_id=image_id)
            database.write_image(image, use_image_id=True)
            database.write_frame(trivial_frame(image), use_frame_id=True)
            database.write_keypoints(image_id, photo.features.keypoints)
            descriptors = pycolmap.FeatureDescriptors(
                type=pycolmap.FeatureExtractorType.SIFT, data=photo.features.descriptors
            )
            database.write_descriptors(image_id, descriptors)
            prior = pycolmap.PosePrior()
            prior.corr_data_id = image.data_id
            prior.coordinate_system = pycolmap.PosePriorCoordinateSystem.WGS84
            prior.position = np.array([47.5, -8.25, 512.0])
            prior.position_covariance = np.diag([0.25, 0.25, 4.0])
            database.write_pose_prior(prior)
            for pair in pairs.get(image_id, []):
                ids = pair.image_id1, pair.image_id2
                database.write_matches(*ids, pair.matches)
                database.write_two_view_geometry(*ids, pair.two_view_geometry)
    assert rows_of(tmp_path / "ours.db") == rows_of(tmp_path / "theirs.db")


def test_what_a_session_needs_is_read_back(orbit, tmp_path):
    exif = Exif(
        make="ä",
        model="b",
        focal_length_mm=24.0,
        captured_at=datetime(2026, 5, 1, 12, 30, 1),
        position=GeoPosition(1.0, 2.0, None),
        orientation=6,
    )
    first = replace(described(orbit, 0), exif=exif, path=tmp_path / "a.jpg", seconds={"sift": 0.5})
    first.path.write_bytes(b"photo")
    second = described(orbit, 1)
    pairs = [true_pair(orbit, 1, 0, (2, 1))]
    why = Rejected(Rejection.TOO_FEW_INLIERS, None, 7)
    candidates = (
        CandidateOutcome("a.jpg", 0.25, 30, True, None),
        CandidateOutcome("b.jpg", 0.125, None, False, why),
    )
    skipped = Skipped("torn.jpg", SkipReason.TRUNCATED, "half")
    with PhotoDatabase(tmp_path / "database.db") as store:
        store.write(1, first, orbit.camera, [])
        store.write(2, second, orbit.camera, pairs, candidates)
        store.write_skipped(skipped, tmp_path / "torn.jpg")
        store.remember("options", "{}")
    with PhotoDatabase(tmp_path / "database.db") as store:
        one, two = store.photos()
        assert (one.image_id, one.name, one.camera_id) == (1, first.name, 1)
        assert (one.width, one.height, one.digest) == (first.width, first.height, first.digest)
        assert one.exif == exif
        assert one.seconds == {"sift": 0.5}
        assert one.num_keypoints == len(first.features)
        assert one.file == FileState.of(first.path)
        assert one.file.size == 5
        np.testing.assert_array_equal(one.global_vector, first.global_vector)
        assert two.candidates == candidates
        assert two.file.size is None  # a file that is gone
        for image_id, photo in ((1, first), (2, second)):
            features = store.features(image_id)
            np.testing.assert_array_equal(features.keypoints, photo.features.keypoints)
            np.testing.assert_array_equal(features.descriptors, photo.features.descriptors)
            np.testing.assert_array_equal(features.colors, photo.features.colors)
            keypoints, colors = store.keypoints(image_id)
            np.testing.assert_array_equal(keypoints, photo.features.keypoints)
            np.testing.assert_array_equal(colors, photo.features.colors)
        assert store.pairs(1) == []
        (read,) = store.pairs(2)
        written = pairs[0]
        assert (read.image_id1, read.image_id2) == (2, 1)
        np.testing.assert_array_equal(read.matches, written.matches)
        geometry, expected = read.two_view_geometry, written.two_view_geometry
        assert geometry.config == expected.config
        assert geometry.tri_angle == expected.tri_angle
        np.testing.assert_array_equal(geometry.inlier_matches, expected.inlier_matches)
        np.testing.assert_allclose(geometry.E, expected.E, atol=ROTATION_TOLERANCE)
        np.testing.assert_allclose(
            geometry.cam2_from_cam1.matrix(),
            expected.cam2_from_cam1.matrix(),
            atol=ROTATION_TOLERANCE,
        )
        (camera,) = store.cameras().values()
        np.testing.assert_array_equal(camera.params, orbit.camera.params)
        assert store.skipped() == [(skipped, FileState.of(tmp_path / "torn.jpg"))]
        assert (store.recall("options"), store.recall("none")) == ("{}", None)
        with pytest.raises(KeyError):
            store.features(3)


def test_a_database_that_could_not_be_made_is_not_there(orbit, tmp_path, monkeypatch):
    """COLMAP commits its tables one by one: a kill in between must not leave some of them."""
    open_database = pycolmap.Database.open

    def stopped(file: os.PathLike[str]) -> None:
        open_database(file).close()
        raise RuntimeError("No registered database factory succeeded.")

    with monkeypatch.context() as patched:
        patched.setattr(pycolmap.Database, "open", stopped)
        with pytest.raises(StorageError, match="COLMAP cannot write there"):
            PhotoDatabase(tmp_path / "database.db")
    assert list(tmp_path.iterdir()) == []
    with PhotoDatabase(tmp_path / "database.db") as store:
        store.write(1, described(orbit, 0), orbit.camera, [])

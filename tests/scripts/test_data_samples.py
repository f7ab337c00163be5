"""The sample that ships with the project: complete, small, and true to its ground truth."""

from __future__ import annotations

import cv2
import numpy as np
import pycolmap
import pytest
from helpers.locations import SAMPLES
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base

VILLAGE = SAMPLES / "village"
LARGEST_BYTES = 6 * 2**20
# As data_samples/README.md states them.
ORIGIN = (45.0, -30.0, 200.0)
GPS_DEVIATION_M = 1.0
EPIPOLAR_MEDIAN_PX = 0.5


@pytest.fixture(scope="module")
def truth() -> pycolmap.Reconstruction:
    return pycolmap.Reconstruction(VILLAGE / "gt")


def test_every_photo_has_its_true_pose_and_the_camera_its_size(truth):
    photos = sorted((VILLAGE / "images").iterdir())
    assert 15 <= len(photos) <= 25
    assert sorted(image.name for image in truth.images.values()) == [p.name for p in photos]
    (camera,) = truth.cameras.values()
    for photo in photos:
        with Image.open(photo) as picture:
            assert picture.size == (camera.width, camera.height)


def test_the_sample_stays_small():
    assert sum(path.stat().st_size for path in SAMPLES.rglob("*")) <= LARGEST_BYTES


def test_exif_agrees_with_the_truth(truth):
    (camera,) = truth.cameras.values()
    errors, times = [], []
    for image in sorted(truth.images.values(), key=lambda image: image.name):
        path = VILLAGE / "images" / image.name
        prior = pycolmap.infer_camera_from_image(path)
        assert prior.has_prior_focal_length
        assert prior.focal_length == pytest.approx(camera.focal_length, rel=0.01)
        with Image.open(path) as picture:
            exif = picture.getexif()
        times.append(exif.get_ifd(IFD.Exif)[Base.DateTimeOriginal])
        tags = exif.get_ifd(IFD.GPSInfo)
        latitude, longitude = (
            float(np.dot(np.array(tags[tag], dtype=float), (1, 1 / 60, 1 / 3600)))
            for tag in (GPS.GPSLatitude, GPS.GPSLongitude)
        )
        place = np.array([[latitude, -longitude, float(tags[GPS.GPSAltitude])]])
        assert (tags[GPS.GPSLatitudeRef], tags[GPS.GPSLongitudeRef]) == ("N", "W")
        east_north_up = pycolmap.GPSTransform().ellipsoid_to_enu(place, *ORIGIN[:2], ORIGIN[2])
        errors.append(np.asarray(east_north_up)[0] - image.projection_center())
    assert times == sorted(set(times))
    deviation = np.std(errors)
    assert 0.5 * GPS_DEVIATION_M < deviation < 1.5 * GPS_DEVIATION_M
    assert np.abs(np.mean(errors, axis=0)).max() < GPS_DEVIATION_M


@pytest.mark.parametrize(("first", "second"), [("0002.jpg", "0003.jpg"), ("0010.jpg", "0011.jpg")])
def test_sift_matches_obey_the_true_epipolar_geometry(truth, first, second):
    sift = cv2.SIFT_create(2000)
    found = []
    for name in (first, second):
        picture = cv2.imread(str(VILLAGE / "images" / name), cv2.IMREAD_GRAYSCALE)
        found.append(sift.detectAndCompute(picture, None))
    (keypoints1, descriptors1), (keypoints2, descriptors2) = found
    pairs = [
        best
        for best, next_best in cv2.BFMatcher().knnMatch(descriptors1, descriptors2, k=2)
        if best.distance < 0.7 * next_best.distance
    ]
    assert len(pairs) > 100
    # OpenCV centres the first pixel at (0, 0), COLMAP at (0.5, 0.5).
    pixels1 = np.array([keypoints1[pair.queryIdx].pt for pair in pairs]) + 0.5
    pixels2 = np.array([keypoints2[pair.trainIdx].pt for pair in pairs]) + 0.5
    (camera,) = truth.cameras.values()
    images = [truth.find_image_with_name(name) for name in (first, second)]
    cam2_from_cam1 = images[1].cam_from_world() * images[0].cam_from_world().inverse()
    essential = pycolmap.essential_matrix_from_pose(cam2_from_cam1)
    rays1, rays2 = (
        np.column_stack([camera.cam_from_img(pixels), np.ones(len(pixels))])
        for pixels in (pixels1, pixels2)
    )
    lines = rays1 @ essential.T
    distance = np.abs((rays2 * lines).sum(axis=1)) / np.hypot(lines[:, 0], lines[:, 1])
    assert np.median(distance) * camera.focal_length < EPIPOLAR_MEDIAN_PX


def test_true_points_project_where_the_truth_says(truth):
    assert truth.num_points3D() > 1000
    assert truth.compute_mean_reprojection_error() < 1e-6
    assert truth.compute_mean_track_length() > 3

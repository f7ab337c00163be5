"""Undistorted photos: COLMAP's pixels, known geometry, exact principal points."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pycolmap
import pytest
from helpers.export_scenes import HEIGHT, LENSES, WIDTH, camera, smooth_picture
from PIL import Image

from sfm_front.errors import InputError
from sfm_front.exporters.undistortion import (
    Projection,
    decoded,
    moved_points,
    resampled,
    source_pixels,
    takes_same_photos,
    target_camera,
)

DISTORTED = [lens for lens in LENSES if "PINHOLE" not in lens]
ROUNDING = 1  # grey levels, between two ways to interpolate
DOT_TOLERANCE_PX = 0.1  # of the centroid of a dot, after resampling
EXACT_PX = 1e-6


def png(picture: Image.Image) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()


def made(picture: Image.Image, source: pycolmap.Camera, target: pycolmap.Camera) -> np.ndarray:
    pixels = decoded(png(picture), source, target)
    assert isinstance(pixels, np.ndarray)
    return resampled(pixels, source_pixels(source, target))


@pytest.mark.parametrize("lens", DISTORTED)
def test_an_undistorted_photo_is_colmaps_own(lens):
    source = camera(lens)
    target = target_camera(source, Projection.PINHOLE, None)
    theirs, their_camera = pycolmap.undistort_image(
        pycolmap.UndistortCameraOptions(),
        pycolmap.Bitmap.from_array(np.asarray(smooth_picture())),
        source,
    )
    np.testing.assert_array_equal(target.params, their_camera.params)
    ours = made(smooth_picture(), source, target)
    assert ours.shape == theirs.to_array().shape
    # The outermost pixels of some lenses lie at the very edge, where ways to interpolate differ.
    difference = np.abs(ours.astype(int) - theirs.to_array())[1:-1, 1:-1]
    assert difference.max() <= ROUNDING


def dots(pixels: np.ndarray) -> np.ndarray:
    """(N, 2) centroids of bright dots, x, y from the outer edge, sorted by column, then row."""
    grey = pixels.astype(float).sum(axis=-1)
    count, labels = cv2.connectedComponents((grey > 15).astype(np.uint8))
    centres = []
    for label in range(1, count):
        y, x = np.nonzero(labels == label)
        weights = grey[y, x]
        centres.append([np.average(x + 0.5, weights=weights), np.average(y + 0.5, weights=weights)])
    return np.array(centres)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("projection", list(Projection))
@pytest.mark.parametrize("max_size", [None, 120])
def test_what_a_photo_shows_is_where_the_new_camera_says(lens, projection, max_size):
    source = camera(lens)
    target = target_camera(source, projection, max_size)
    x, y = (
        grid.ravel() for grid in np.meshgrid(np.arange(30, 171, 20.0), np.arange(30, 121, 20.0))
    )
    places = np.column_stack([x, y])
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    for column, row in places.astype(int):
        # Four by four around the corner of pixels, so that its centroid is at whole numbers.
        picture[row - 2 : row + 2, column - 2 : column + 2] = 255
    expected = moved_points(places, source, target)
    found = dots(made(Image.fromarray(picture), source, target))
    inside = np.all((expected > 4) & (expected < [target.width - 4, target.height - 4]), axis=1)
    assert inside.sum() > 20
    for place in expected[inside]:
        assert np.linalg.norm(found - place, axis=1).min() < DOT_TOLERANCE_PX


@pytest.mark.parametrize("lens", LENSES)
def test_moved_keypoints_are_where_their_points_project(lens):
    source = camera(lens)
    target = target_camera(source, Projection.CENTRED_PINHOLE, 130)
    points = np.random.default_rng(0).uniform([-1, -0.8, 3], [1, 0.8, 5], (50, 3))
    there = moved_points(np.asarray(source.img_from_cam(points)), source, target)
    np.testing.assert_allclose(there, target.img_from_cam(points), rtol=0, atol=EXACT_PX)


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("max_size", [None, 120])
def test_a_centred_camera_has_its_principal_point_in_the_middle(lens, max_size):
    source = camera(lens)
    target = target_camera(source, Projection.CENTRED_PINHOLE, max_size)
    assert target.model_name == "PINHOLE"
    assert target.camera_id == source.camera_id
    middle = target.width / 2, target.height / 2
    centre = target.principal_point_x, target.principal_point_y
    np.testing.assert_allclose(centre, middle, rtol=0, atol=EXACT_PX)
    assert max(target.width, target.height) <= (max_size or WIDTH * 2)
    if max_size is None:
        whole = target_camera(source, Projection.PINHOLE, None)
        x, y = whole.principal_point_x, whole.principal_point_y
        kept = 2 * min(x, whole.width - x), 2 * min(y, whole.height - y)
        np.testing.assert_allclose((target.width, target.height), np.floor(kept), atol=EXACT_PX)
        assert target.focal_length_x == pytest.approx(source.focal_length_x)


def test_what_is_fine_already_stays():
    plain, lens = camera("PINHOLE"), camera("SIMPLE_RADIAL")
    for projection, source in [
        (Projection.AS_TAKEN, lens),
        (Projection.PINHOLE, plain),
        (Projection.CENTRED_PINHOLE, camera("SIMPLE_PINHOLE")),
    ]:
        assert takes_same_photos(source, target_camera(source, projection, 200))
    for projection, source, size in [
        (Projection.AS_TAKEN, lens, 199),
        (Projection.PINHOLE, lens, None),
        (Projection.CENTRED_PINHOLE, plain, None),
    ]:
        assert not takes_same_photos(source, target_camera(source, projection, size))


def test_a_panorama_is_refused():
    panorama = pycolmap.Camera(model="EQUIRECTANGULAR", width=200, height=100, params=[200, 100])
    with pytest.raises(InputError, match="EQUIRECTANGULAR cannot be undistorted"):
        target_camera(panorama, Projection.PINHOLE, None)


def test_a_principal_point_outside_the_photo_is_refused():
    crop = pycolmap.Camera(model="PINHOLE", width=200, height=100, params=[200, 200, -5, 50])
    with pytest.raises(InputError, match="principal point lies outside"):
        target_camera(crop, Projection.CENTRED_PINHOLE, None)


def test_a_photo_of_another_size_tells_its_size():
    source = camera("SIMPLE_RADIAL")
    assert decoded(png(smooth_picture().resize((100, 90))), source, source) == (100, 90)

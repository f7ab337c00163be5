"""Photos through another lens: what is seen where, and no blank pixels."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.lenses.rendering import LENSES, PLAIN, check_lenses, render, through
from sfm_front.evaluation.reconstruction.scenes import find_scene

WIDTH, HEIGHT = 320, 240
CAMERA = pycolmap.Camera(
    camera_id=1,
    model="SIMPLE_RADIAL",
    width=WIDTH,
    height=HEIGHT,
    params=[250.0, 165.0, 117.0, -0.05],
)


@pytest.fixture
def scene(tmp_path):
    """One photo of a white square on grey, whose corners lie in known directions, and its truth."""
    pixels = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    pixels[40:80, 50:90] = 255
    images = tmp_path / "scene" / "images"
    images.mkdir(parents=True)
    cv2.imwrite(str(images / "a.png"), pixels)
    truth = pycolmap.Reconstruction()
    truth.add_camera_with_trivial_rig(CAMERA)
    image = pycolmap.Image(name="a.png", camera_id=1, image_id=1)
    truth.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
    (images.parent / "gt").mkdir()
    truth.write(images.parent / "gt")
    return find_scene(images.parent)


@pytest.mark.parametrize("lens", LENSES)
def test_things_are_seen_where_the_lens_has_them(scene, lens, tmp_path):
    rendered = render(scene, LENSES[lens], tmp_path / "out")
    assert (rendered.truth, rendered.num_photos) == (scene.truth, 1)
    photo = cv2.imread(str(rendered.photos / "a.png"), cv2.IMREAD_GRAYSCALE)
    assert photo.shape == (HEIGHT, WIDTH)
    assert photo.min() > 100  # nothing is blank
    rows, columns = np.nonzero(photo > 200)
    seen = through(LENSES[lens], CAMERA)
    middle = np.array(CAMERA.cam_from_img(np.array([[70.0, 60.0]])))
    expected = seen.img_from_cam(np.column_stack([middle, [1.0]]))[0]
    np.testing.assert_allclose([columns.mean() + 0.5, rows.mean() + 0.5], expected, atol=1.0)


def test_a_camera_without_distortion_stays_as_it_is():
    plain = pycolmap.Camera(
        camera_id=3, model="PINHOLE", width=WIDTH, height=HEIGHT, params=[250, 250, 160, 120]
    )
    assert through(LENSES[PLAIN], plain).params.tolist() == [250, 250, 160, 120]
    assert through(LENSES[PLAIN], plain).camera_id == 3


def test_what_cannot_be_rendered_is_said(scene, tmp_path):
    with pytest.raises(ConfigError, match="no lens pinhole; there are undistorted"):
        check_lenses(["pinhole"])
    cv2.imwrite(str(scene.photos / "a.png"), np.zeros((10, 10, 3), np.uint8))
    with pytest.raises(InputError, match=r"a\.png: not a photo of the ground truth's camera"):
        render(scene, LENSES[PLAIN], tmp_path / "out")
    (Path(scene.truth) / "cameras.bin").unlink()
    bare = find_scene(scene.photos.parent)
    with pytest.raises(InputError, match="no ground truth beside it"):
        render(bare, LENSES[PLAIN], tmp_path / "out")

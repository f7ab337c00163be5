"""The last bundle adjustment: robust to wrong matches, and careful with the principal point."""

from __future__ import annotations

import copy

import numpy as np
import pycolmap
import pytest

from sfm_front.errors import ConfigError
from sfm_front.mapping.bundle_adjustment import RobustAdjustmentOptions
from sfm_front.mapping.final_adjustment import final_adjustment

FOCAL_PX, WIDTH, HEIGHT = 1000.0, 1024, 768
OFF_CENTRE = (WIDTH / 2 + 8.0, HEIGHT / 2 - 10.0)
MAX_ERROR_PX = 4.0
FAR_OFF = (WIDTH / 2 + 60.0, HEIGHT / 2)


def truth(principal_point: tuple[float, float], num_photos: int = 10) -> pycolmap.Reconstruction:
    """A scene whose one camera has this principal point, with 0.3 px of noise."""
    pycolmap.set_random_seed(0)
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1,
        num_cameras_per_rig=1,
        num_frames_per_rig=num_photos,
        num_points3D=300,
        camera_width=WIDTH,
        camera_height=HEIGHT,
        camera_model_id=pycolmap.CameraModelId.SIMPLE_RADIAL,
        camera_params=[FOCAL_PX, *principal_point, 0.01],
        camera_has_prior_focal_length=False,
    )
    model = pycolmap.synthesize_dataset(options)
    pycolmap.synthesize_noise(pycolmap.SyntheticNoiseOptions(point2D_stddev=0.3), model)
    return model


def centred(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """The model as mapping leaves it: adjusted with the principal point held in the middle."""
    model = copy.deepcopy(model)
    camera = model.camera(next(iter(model.cameras)))
    camera.params = [FOCAL_PX, WIDTH / 2, HEIGHT / 2, 0.0]
    options = pycolmap.BundleAdjustmentOptions(print_summary=False)
    pycolmap.bundle_adjustment(model, options)
    model.update_point_3d_errors()
    return model


def principal_point(model: pycolmap.Reconstruction) -> list[float]:
    camera = model.camera(next(iter(model.cameras)))
    return [camera.principal_point_x, camera.principal_point_y]


@pytest.mark.parametrize("has_exif", [False, True])
def test_a_principal_point_off_the_middle_is_found(has_exif):
    """EXIF tells the focal length, not where the axis meets the sensor; it is not tangential
    distortion, either, by which OPENCV's model could feign it."""
    model = centred(truth(OFF_CENTRE))
    model.camera(next(iter(model.cameras))).has_prior_focal_length = has_exif
    polished = final_adjustment(model, RobustAdjustmentOptions()).reconstruction
    assert polished.camera(next(iter(polished.cameras))).model_name == "SIMPLE_RADIAL"
    np.testing.assert_allclose(principal_point(polished), OFF_CENTRE, atol=2.0)


@pytest.mark.parametrize(
    ("point", "photos", "refine"),
    [
        ((WIDTH / 2, HEIGHT / 2), 10, True),  # nothing to gain
        (FAR_OFF, 10, True),  # farther off than a crop explains
        (OFF_CENTRE, 5, True),  # too few photos to tell
        (OFF_CENTRE, 10, False),  # intrinsics are to stay
    ],
)
def test_otherwise_it_stays_in_the_middle(point, photos, refine):
    model = centred(truth(point, photos))
    polished = final_adjustment(
        model, RobustAdjustmentOptions(refine_intrinsics=refine)
    ).reconstruction
    assert principal_point(polished) == [WIDTH / 2, HEIGHT / 2]


def test_points_that_do_not_fit_are_dropped():
    model = truth((WIDTH / 2, HEIGHT / 2))
    wrong = sorted(model.points3D)[:5]
    for point_id in wrong:
        element = model.point3D(point_id).track.elements[0]
        image = model.image(element.image_id)
        image.points2D[element.point2D_idx].xy = [WIDTH - 1.0, HEIGHT - 1.0]
    polished = final_adjustment(centred(model), RobustAdjustmentOptions()).reconstruction
    assert len(polished.points3D) > 250
    assert max(point.error for point in polished.points3D.values()) < MAX_ERROR_PX


def test_a_model_without_points_stays_as_it_is():
    model = truth((WIDTH / 2, HEIGHT / 2))
    for point_id in list(model.points3D):
        model.delete_point3D(point_id)
    polished = final_adjustment(model, RobustAdjustmentOptions()).reconstruction
    assert principal_point(polished) == [WIDTH / 2, HEIGHT / 2]
    assert polished.num_reg_images() == 10


@pytest.mark.parametrize(
    "wrong", [{"loss_scale_px": 0}, {"tolerance": -1}, {"large_tolerance": -1}]
)
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        RobustAdjustmentOptions(**wrong)


def test_a_large_model_is_adjusted_longer():
    """With a tolerance that lets it stop at once, a wrong focal length stays."""
    model = centred(truth((WIDTH / 2, HEIGHT / 2)))
    camera = model.camera(next(iter(model.cameras)))
    camera.params = [1.02 * FOCAL_PX, *camera.params[1:]]

    def focal_error_px(large_from: int) -> float:
        options = RobustAdjustmentOptions(
            tolerance=0.9, large_tolerance=1e-6, large_from=large_from
        )
        polished = final_adjustment(copy.deepcopy(model), options).reconstruction
        return abs(polished.camera(next(iter(polished.cameras))).mean_focal_length() - FOCAL_PX)

    assert focal_error_px(large_from=10) < 0.5 * focal_error_px(large_from=11)


def test_wrong_matches_weigh_less_than_in_least_squares():
    exact = truth((WIDTH / 2, HEIGHT / 2))
    rng = np.random.default_rng(0)
    for image in exact.images.values():
        for index in rng.choice(image.num_points2D(), image.num_points2D() // 20, replace=False):
            image.points2D[index].xy += rng.choice([-6.0, 6.0], 2)
    plain = centred(exact)
    robust = final_adjustment(copy.deepcopy(plain), RobustAdjustmentOptions()).reconstruction

    def focal_error_px(model: pycolmap.Reconstruction) -> float:
        return abs(model.camera(next(iter(model.cameras))).mean_focal_length() - FOCAL_PX)

    assert focal_error_px(robust) < 0.5 * focal_error_px(plain)
    assert focal_error_px(robust) < 2.0

"""What residuals say of a lens: predicted falls of the error, and standard deviations."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from helpers.lens_making import FOCAL_PX, HEIGHT, WIDTH, as_mapped, camera_of, true_model

from sfm_front.mapping.lens_evidence import LensEvidence, Param
from sfm_front.mapping.observation_sample import ObservationSample

SIMPLE = (Param.FOCAL, Param.K1)
RADIAL = (*SIMPLE, Param.K2)
TANGENTIAL = (*SIMPLE, Param.P1, Param.P2)
OFF_MIDDLE = (*SIMPLE, Param.CX, Param.CY)


def fall(evidence: LensEvidence, params) -> float:
    return 1 - (1 - evidence.explained(params)) / (1 - evidence.explained(SIMPLE))


def evidence_of(lens: str, distortion) -> LensEvidence:
    found = LensEvidence.of(as_mapped(true_model(camera_of(lens, distortion))), 1)
    assert found is not None
    return found


def test_the_term_that_is_missing_explains_most():
    radial = evidence_of("RADIAL", (-0.1, 0.15))
    assert fall(radial, RADIAL) > 0.1
    assert fall(radial, TANGENTIAL) < 0.2 * fall(radial, RADIAL)
    tangential = evidence_of("OPENCV", (-0.1, 0.0, 0.002, -0.003))
    assert fall(tangential, TANGENTIAL) > 0.1
    assert fall(tangential, RADIAL) < 0.3 * fall(tangential, TANGENTIAL)
    # They look alike, but not the same.
    assert fall(tangential, OFF_MIDDLE) < 0.95 * fall(tangential, TANGENTIAL)


def test_a_lens_that_is_right_leaves_nothing_to_explain():
    right = evidence_of("SIMPLE_RADIAL", (-0.1,))
    assert right.explained(tuple(Param)) < 0.01


def test_the_standard_deviation_is_that_of_many_scenes():
    """Of the errors of the focal length, with the noise drawn anew each time."""
    errors, sigmas = [], []
    for seed in range(25):
        model = true_model(camera_of("SIMPLE_RADIAL", (-0.05,)), num_photos=6, seed=seed)
        mapped = as_mapped(model)
        found = LensEvidence.of(mapped, 1)
        assert found is not None
        errors.append(mapped.camera(1).mean_focal_length() / FOCAL_PX - 1)
        sigmas.append(found.focal_sigma(SIMPLE))
    # 25 errors tell their standard deviation to 14 %.
    assert np.mean(sigmas) == pytest.approx(np.std(errors), rel=0.4)


def test_parallel_views_of_a_plane_do_not_tell_the_focal_length():
    camera = camera_of("SIMPLE_RADIAL", (0.0,))
    oblique = true_model(camera, relief=0.01)
    nadir = true_model(camera, relief=0.01, tilt_deg=0)
    sigmas = [LensEvidence.of(model, 1).focal_sigma(SIMPLE) for model in (oblique, nadir)]
    assert sigmas[1] > 20 * sigmas[0]


def test_nothing_is_said_of_a_fisheye_or_without_points():
    model = true_model(camera_of("OPENCV", (0, 0, 0, 0)))
    without_points = true_model(camera_of("OPENCV", (0, 0, 0, 0)))
    for point_id in list(without_points.points3D):
        without_points.delete_point3D(point_id)
    assert LensEvidence.of(without_points, 1) is None
    camera = model.camera(1)
    camera.model = pycolmap.CameraModelId.OPENCV_FISHEYE
    camera.params = [FOCAL_PX, FOCAL_PX, WIDTH / 2, HEIGHT / 2, 0, 0, 0, 0]
    assert LensEvidence.of(model, 1) is None


def test_a_sample_is_of_photos_that_see_the_same_points():
    pycolmap.set_random_seed(0)
    model = pycolmap.synthesize_dataset(
        pycolmap.SyntheticDatasetOptions(
            num_rigs=1, num_cameras_per_rig=1, num_frames_per_rig=80, num_points3D=300
        )
    )
    sample = ObservationSample.of(model, 1)
    assert len(sample.rotations) == 50
    assert np.bincount(sample.point).min() >= 3
    assert sample.photo.max() == 49
    camera = model.camera(1)
    seen = np.einsum("kij,kj->ki", sample.rotations[sample.photo], sample.points[sample.point])
    seen += sample.translations[sample.photo]
    np.testing.assert_allclose(np.asarray(camera.img_from_cam(seen)), sample.pixels, atol=1e-6)

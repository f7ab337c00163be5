"""Errors of relative poses and their AUC, on cases worked by hand."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from helpers.model_building import looking, make_model

from sfm_front.errors import InputError
from sfm_front.evaluation.poses import auc, pose_errors

UP = [0, 0, 1]
ANGLE = 1e-6  # degrees that float64 costs on the way through a quaternion


def three_cameras():
    return {
        "a.jpg": looking([0, 0, 0], [0, 1, 0], UP),
        "b.jpg": looking([1, 0, 0], [0, 1, 0], UP),
        "c.jpg": looking([2, 1, 0], [0.3, 1, 0], UP),
    }


def turned(cam_from_world, degrees):
    """The camera where it was, turned about its own optical axis."""
    half = np.radians(degrees) / 2
    turn = pycolmap.Rigid3d(pycolmap.Rotation3d([0, 0, np.sin(half), np.cos(half)]), np.zeros(3))
    return turn * cam_from_world


def test_the_truth_in_another_frame_and_scale_has_no_error():
    truth, model = make_model(three_cameras()), make_model(three_cameras())
    rotation = pycolmap.Rotation3d(np.array([0.1, 0.7, -0.3, 0.6]))
    model.transform(pycolmap.Sim3d(3.7, rotation, np.array([5.0, -2.0, 9.0])))
    np.testing.assert_allclose(pose_errors(truth, [model]), [0, 0, 0], atol=ANGLE)


def test_a_camera_turned_on_the_spot_is_wrong_by_that_angle_in_its_pairs_only():
    cameras = three_cameras()
    model = make_model({**cameras, "b.jpg": turned(cameras["b.jpg"], 4.0)})
    # Pairs in order: ab, ac, bc. Seen from b, the direction to the others turns with it.
    np.testing.assert_allclose(pose_errors(make_model(cameras), [model]), [4, 0, 4], atol=ANGLE)


def test_a_camera_moved_aside_has_the_angle_between_the_baselines():
    truth = {
        "a.jpg": looking([0, 0, 0], [0, 1, 0], UP),
        "b.jpg": looking([1, 0, 0], [0, 1, 0], UP),
    }
    moved = {**truth, "b.jpg": looking([1, np.tan(np.radians(2)), 0], [0, 1, 0], UP)}
    opposite = {**truth, "b.jpg": looking([-1, 0, 0], [0, 1, 0], UP)}
    errors = [pose_errors(make_model(truth), [make_model(found)]) for found in (moved, opposite)]
    np.testing.assert_allclose(errors, [[2], [180]], atol=ANGLE)


@pytest.mark.parametrize(("turn", "expected"), [(0.5, 2.5), (-5.0, 5.0)])
def test_the_larger_of_both_errors_counts(turn, expected):
    # b has moved so that a appears 2 degrees further to the left, and has turned to the right.
    truth = {
        "a.jpg": looking([0, 0, 0], [0, 1, 0], UP),
        "b.jpg": looking([1, 0, 0], [0, 1, 0], UP),
    }
    heading = [np.sin(np.radians(turn)), np.cos(np.radians(turn)), 0]
    moved = looking([1, np.tan(np.radians(2)), 0], heading, UP)
    error = pose_errors(make_model(truth), [make_model({**truth, "b.jpg": moved})])
    np.testing.assert_allclose(error, [expected], atol=ANGLE)


def test_a_missing_photo_makes_its_pairs_infinite():
    cameras = three_cameras()
    model = make_model({name: cameras[name] for name in ("a.jpg", "c.jpg")})
    errors = pose_errors(make_model(cameras), [model])
    np.testing.assert_array_equal(np.isinf(errors), [True, False, True])
    assert np.isinf(pose_errors(make_model(cameras), [])).all()


def test_photos_of_different_models_are_no_pair():
    cameras = {**three_cameras(), "d.jpg": looking([3, 0, 0], [0, 1, 0], UP)}
    models = [
        make_model({name: cameras[name] for name in pair})
        for pair in (("a.jpg", "b.jpg"), ("c.jpg", "d.jpg"))
    ]
    errors = pose_errors(make_model(cameras), models)  # ab ac ad bc bd cd
    np.testing.assert_array_equal(np.isfinite(errors), [True, False, False, False, False, True])


def test_of_two_models_with_a_pair_the_larger_counts():
    cameras = three_cameras()
    small = make_model({"a.jpg": cameras["a.jpg"], "b.jpg": turned(cameras["b.jpg"], 30)})
    for models in ([small, make_model(cameras)], [make_model(cameras), small]):
        assert pose_errors(make_model(cameras), models)[0] == pytest.approx(0, abs=ANGLE)


def test_names_match_in_any_case_and_unknown_photos_of_the_model_do_not_matter():
    cameras = three_cameras()
    model = {name.upper(): pose for name, pose in cameras.items()}
    model["other.jpg"] = looking([9, 9, 9], [0, 1, 0], UP)
    errors = pose_errors(make_model(cameras), [make_model(model)])
    np.testing.assert_allclose(errors, [0, 0, 0], atol=ANGLE)


def test_only_the_pairs_asked_for_are_judged():
    cameras = three_cameras()
    model = make_model({**cameras, "b.jpg": turned(cameras["b.jpg"], 4.0)})
    errors = pose_errors(make_model(cameras), [model], [("c.jpg", "a.jpg"), ("b.jpg", "c.jpg")])
    np.testing.assert_allclose(errors, [0, 4], atol=ANGLE)
    with pytest.raises(InputError, match=r"no pose of 'z\.jpg'"):
        pose_errors(make_model(cameras), [model], [("a.jpg", "z.jpg")])


def test_photos_from_one_place_are_judged_by_rotation_alone():
    truth = {
        "a.jpg": looking([1, 2, 3], [0, 1, 0], UP),
        "b.jpg": looking([1, 2, 3], [1, 1, 0], UP),
        "c.jpg": looking([2, 2, 3], [0, 1, 0], UP),
    }
    found = {**truth, "b.jpg": turned(looking([1.01, 2, 3], [1, 1, 0], UP), 3)}
    errors = pose_errors(make_model(truth), [make_model(found)])
    assert errors[0] == pytest.approx(3, abs=ANGLE)
    # The other way round, a baseline is lost: the direction is as wrong as can be.
    assert pose_errors(make_model(found), [make_model(truth)])[0] == 180


def test_names_that_differ_in_case_alone_are_refused():
    pose = looking([0, 0, 0], [0, 1, 0], UP)
    with pytest.raises(InputError, match="ignoring case"):
        pose_errors(make_model({"a.jpg": pose, "A.jpg": pose}), [])


@pytest.mark.parametrize(
    ("errors", "threshold", "expected"),
    [
        # A straight line from (0, 0) to (1, 1/2), level to 2: 1/4 + 1/2, over 2.
        ([1.0, np.inf], 2.0, 0.375),
        # (0, 0) to (1, 1/2) to (3, 1), level to 4: 1/4 + 3/2 + 1, over 4.
        ([3.0, 1.0], 4.0, 0.6875),
        # An error at the threshold and one beyond it: level at 1/3 from 1 to 2.
        ([1.0, 2.0, 5.0], 2.0, (1 / 6 + 1 / 3) / 2),
        ([0.0, 0.0], 1.0, 1.0),
        ([np.inf, np.inf], 5.0, 0.0),
        ([7.0], 5.0, 0.0),
        # Ties: up to (1, 1/4), then straight up to 1.
        ([1.0, 1.0, 1.0, 1.0], 2.0, (1 / 8 + 1) / 2),
    ],
)
def test_the_area_is_exact(errors, threshold, expected):
    assert auc(np.array(errors), [threshold]) == pytest.approx([expected])


def test_the_area_does_not_depend_on_the_order():
    errors = np.random.default_rng(0).exponential(2.0, 50)
    assert auc(errors) == auc(errors[::-1])
    assert auc(errors)[0] < auc(errors)[1] < auc(errors)[2] < 1


def test_no_errors_have_no_area():
    with pytest.raises(ValueError, match="no errors"):
        auc(np.array([]))

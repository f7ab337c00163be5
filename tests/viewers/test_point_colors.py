"""What the colours of points say."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.model_building import looking, make_model, model_of

from sfm_front.viewers.model_drawing import build_scene
from sfm_front.viewers.options import DrawOptions
from sfm_front.viewers.point_colors import COLORINGS, point_colors, ramp, sequence_colors

UP = np.array([0.0, 0.0, 1.0])
LOW, HIGH = ramp(np.array([0.0, 1.0]))
GREY = 0.5


def colors_of(model, coloring, up=UP):
    points = [point for _, point in sorted(model.points3D.items())]
    return point_colors(points, sorted(model.reg_image_ids()), coloring, up, GREY)


def test_the_ramp_goes_from_blue_to_red():
    assert (LOW.argmax(), HIGH.argmax()) == (2, 0)


def test_height_is_along_what_is_up():
    points = np.array([[0, 5, z] for z in np.linspace(2.0, 4.0, 101)])
    model = make_model({"a.jpg": looking([0, 0, 0], [0, 1, 0], UP)}, points)
    colors, legend = colors_of(model, "height")
    np.testing.assert_allclose((colors[0], colors[-1]), (LOW, HIGH))
    assert legend == "height: 2.04 blue, 3.96 red"
    upside_down, _ = colors_of(model, "height", -UP)
    np.testing.assert_allclose((upside_down[0], upside_down[-1]), (HIGH, LOW))


def test_a_wrong_point_does_not_take_the_ramp():
    points = np.array([[0, 5, z] for z in [*np.linspace(2.0, 4.0, 200), 1e6]])
    model = make_model({"a.jpg": looking([0, 0, 0], [0, 1, 0], UP)}, points)
    colors, _ = colors_of(model, "height")
    assert np.abs(colors[0] - colors[100]).max() > 0.2


def test_points_that_few_photos_see_are_red():
    colors, legend = colors_of(model_of([["a", "b"], ["a", "b", "c", "d", "e"]]), "track")
    np.testing.assert_allclose(colors, [HIGH, LOW])
    assert legend == "photos that see a point: 2 red, 5 blue"


def test_large_errors_are_red():
    model = model_of([["a", "b"], ["a", "b"]])
    for error, (_, point) in zip((0.25, 2.0), sorted(model.points3D.items()), strict=True):
        point.error = error
    colors, legend = colors_of(model, "error")
    np.testing.assert_allclose(colors, [LOW, HIGH])
    assert legend.startswith("reprojection error: ")


def test_a_point_has_the_colour_of_the_first_photo_that_sees_it():
    model = model_of([["c", "b"], ["a", "c"], ["c", "d"]])
    colors, _ = colors_of(model, "photo")
    np.testing.assert_allclose(colors, sequence_colors(4)[[1, 0, 2]])
    unseen = make_model({"a.jpg": looking([0, 0, 0], [0, 1, 0], UP)}, np.array([[0.0, 5, 0]]))
    np.testing.assert_allclose(colors_of(unseen, "photo")[0], [[GREY] * 3])


@pytest.mark.parametrize("coloring", COLORINGS)
def test_each_can_be_drawn_and_one_point_is_enough(coloring):
    model = model_of([["a", "b"]])
    scene = build_scene(model, DrawOptions(coloring=coloring))
    assert scene.point_colors.shape == (1, 3)
    assert ((scene.point_colors >= 0) & (scene.point_colors <= 1)).all()
    assert len(scene.legends) == (coloring != "rgb")
    empty = make_model({"a.jpg": looking([0, 0, 0], [0, 1, 0], UP)})
    assert build_scene(empty, DrawOptions(coloring=coloring)).point_colors.shape == (0, 3)

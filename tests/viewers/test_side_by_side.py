"""Models without a common frame stand apart and upright."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pycolmap
import pytest
from helpers.model_building import looking, make_model

from sfm_front.viewers.model_drawing import build_scene
from sfm_front.viewers.side_by_side import UP, place_side_by_side, up_of


def ring(count: int, size: float = 1.0):
    """Photos from a circle around a block, all level."""
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    spots = size * np.stack([4 * np.cos(angles), 4 * np.sin(angles), 0 * angles], axis=1)
    block = size * np.random.default_rng(0).uniform(-1, 1, (300, 3))
    return make_model({f"{i}.jpg": looking(s, -s, UP) for i, s in enumerate(spots)}, block)


def tilted(model, axis, angle):
    rotation = pycolmap.Rotation3d(np.array(axis, float) * angle)
    model.transform(pycolmap.Sim3d(1.0, rotation, np.array([9.0, -4.0, 2.0])))
    return model


def extent(model):
    """Lowest and highest corner of its points and cameras."""
    points = np.array([point.xyz for point in model.points3D.values()])
    centres = [model.images[i].projection_center() for i in model.reg_image_ids()]
    everything = np.concatenate([points, centres])
    return everything.min(axis=0), everything.max(axis=0)


@pytest.fixture
def placed():
    models = [
        tilted(ring(12), [1, 0, 0], 0.7),
        tilted(ring(12, 50.0), [0, 1, 0], np.pi),
        tilted(ring(3, 0.01), [1, 1, 0], -2.0),
    ]
    place_side_by_side(models)
    return models


def test_all_are_upright(placed):
    for model in placed:
        assert up_of(model) @ UP == pytest.approx(1.0)


def test_none_reaches_into_another_and_all_stand_on_one_floor(placed):
    boxes = [extent(model) for model in placed]
    for (_, high), (low, _) in pairwise(boxes):
        assert high[0] < low[0]
    floors = [low[2] for low, _ in boxes]
    assert np.ptp(floors) < 0.1 * (boxes[0][1][2] - boxes[0][0][2])


def test_the_first_keeps_its_size_and_others_have_that_of_their_photos(placed):
    sizes = [np.linalg.norm(high - low) for low, high in map(extent, placed)]
    first = np.linalg.norm(np.subtract(*extent(ring(12))))
    assert sizes[0] == pytest.approx(first, rel=0.05)
    assert sizes[1] == pytest.approx(first, rel=0.05)
    assert sizes[2] == pytest.approx(first / 2, rel=0.1)  # a quarter of the photos


def test_all_are_in_one_picture(placed):
    scene = build_scene(placed, up=UP)
    assert len(scene.points) == 900
    assert len(scene.vertices) == 5 * (12 + 12 + 3)
    assert scene.view.up @ UP > 0.8

"""Keypoints read at once are those that pycolmap hands out one by one."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.export_scenes import exact_model, model_folder

from sfm_front.errors import InputError
from sfm_front.storage.model_keypoints import read_point_keypoints


def test_they_are_those_of_pycolmap(tmp_path):
    model = exact_model(("OPENCV", "PINHOLE"), names=("a b.jpg", "ü/森.jpg", "c.jpg"))
    found = read_point_keypoints(model_folder(tmp_path, model))
    assert set(found) == set(model.images)
    for image_id, keypoints in found.items():
        points = model.images[image_id].get_observation_points2D()
        np.testing.assert_array_equal(keypoints.xy, [point.xy for point in points])
        np.testing.assert_array_equal(keypoints.point_ids, [point.point3D_id for point in points])
        assert len(points) < model.images[image_id].num_points2D()


def test_a_missing_file_is_said(tmp_path):
    with pytest.raises(InputError, match=r"images\.bin: cannot be read"):
        read_point_keypoints(tmp_path)

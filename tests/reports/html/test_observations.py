"""A model's points and who sees them, as arrays."""

from __future__ import annotations

import numpy as np
import pycolmap
import pytest
from helpers.export_scenes import exact_model, model_folder
from helpers.report_making import Output, finished_output, observed

from sfm_front.errors import InputError
from sfm_front.reports.html.observations import observations_of

NUMERIC_PX = 1e-6
# 0.5 px of noise on each axis, of thousands of keypoints.
NOISE_PX = pytest.approx(0.5, rel=0.1)


def test_keypoints_project_to_where_they_are(tmp_path):
    model = exact_model(("SIMPLE_RADIAL", "OPENCV"))
    found = observations_of(model, model_folder(tmp_path, model))
    assert np.abs(found.residuals_px).max() < NUMERIC_PX
    assert len(found.point) == model.compute_num_observations()


def test_observations_are_those_of_the_model(tmp_path):
    folder = finished_output(tmp_path / "out", Output()) / "sparse" / "0"
    model = pycolmap.Reconstruction(folder)
    found = observations_of(model, folder)
    point_ids = np.array(sorted(model.point3D_ids()))
    ours = zip(found.image_ids[found.photo].tolist(), point_ids[found.point].tolist(), strict=True)
    assert set(ours) == observed(model, found.image_ids.tolist())
    lengths = [model.points3D[i].track.length() for i in point_ids.tolist()]
    assert found.track_lengths.tolist() == lengths
    seen = {i: model.images[i].num_points3D for i in found.image_ids.tolist()}
    assert found.points_seen == seen
    np.testing.assert_allclose(found.xyz, [model.points3D[i].xyz for i in point_ids.tolist()])
    assert found.residuals_px.std(axis=0).tolist() == [NOISE_PX, NOISE_PX]


def test_residuals_are_keypoint_less_projection(tmp_path):
    model = exact_model()
    moved = model.images[2].points2D[1]
    moved.xy += np.array([3.0, -2.0])
    found = observations_of(model, model_folder(tmp_path, model))
    largest = np.abs(found.residuals_px).sum(axis=1).argmax()
    np.testing.assert_allclose(found.residuals_px[largest], [3, -2], atol=NUMERIC_PX)
    assert found.image_ids[found.photo[largest]] == 2


@pytest.mark.parametrize("kept", [0, 30, -10])
def test_a_torn_file_is_refused(tmp_path, kept):
    model = exact_model()
    folder = model_folder(tmp_path, model)
    file = folder / "images.bin"
    file.write_bytes(file.read_bytes()[:kept])
    with pytest.raises(InputError, match=r"images\.bin"):
        observations_of(model, folder)

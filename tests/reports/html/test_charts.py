"""Scales, bars and areas; cells of the match matrix; arrows over a photo; discs."""

from __future__ import annotations

import re
from base64 import b64decode
from io import BytesIO

import numpy as np
import pycolmap
import pytest
from helpers.export_scenes import exact_model, model_folder
from helpers.report_making import Output, finished_output
from PIL import Image

from sfm_front.reports.html.charts import Series, histogram, nice_step, nice_ticks, stacked_areas
from sfm_front.reports.html.distributions import reprojection_errors, track_lengths
from sfm_front.reports.html.match_matrix import match_matrix
from sfm_front.reports.html.material_reading import read_material
from sfm_front.reports.html.observations import observations_of
from sfm_front.reports.html.residual_grid import residual_grid
from sfm_front.reports.html.splatting import reduced, splat
from sfm_front.reports.html.stage_times import stage_times

RED, BLUE = [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("extent", "count", "step"), [(10, 5, 2), (7, 5, 2), (0.3, 4, 0.1), (1234, 5, 500), (0, 5, 0)]
)
def test_steps_are_round(extent, count, step):
    assert nice_step(extent, count) == pytest.approx(step, abs=1e-12)


def test_ticks_begin_at_0_and_stay_inside():
    assert nice_ticks(1000, 4) == [0, 500, 1000]
    assert nice_ticks(0.9, 4)[-1] <= 0.9


def test_bars_are_as_high_as_their_counts():
    drawing = histogram([1, 4, 2], [0, 1, 2, 3], title="t", xlabel="x", ticks=[(1, "one")])
    heights = [float(h) for h in re.findall(r'height="([\d.]+)" class="bar"', drawing)]
    assert np.array(heights) / heights[0] == pytest.approx([1, 4, 2], rel=1e-3)


def test_areas_lie_upon_each_other():
    layers = [Series("a", np.array([1.0, 2.0])), Series("b", np.array([3.0, 0.0]))]
    drawing = stacked_areas(
        layers, title="t", xlabel="x", ylabel="y", ticks=[], column_title=lambda c: f"<{c}>"
    )
    polygons = re.findall(r'points="([^"]+)"', drawing)
    first, second = (
        [float(point.split(",")[1]) for point in polygon.split(" ")] for polygon in polygons
    )
    assert first[:4] == second[4:][::-1]
    assert second[2] == first[2]  # no b in the second column
    assert "&lt;1&gt;" in drawing


def test_long_sessions_have_means_for_columns(tmp_path, monkeypatch):
    monkeypatch.setattr("sfm_front.reports.html.stage_times._MOST_COLUMNS", 3)
    material = read_material(finished_output(tmp_path / "out", Output(has_model=False)))
    chart = stage_times(material)
    # Nine photos that took 0.1 s more for matching each.
    assert re.findall(r"matching (\d+) ms\n", chart) == ["100", "400", "700"]


def test_the_matrix_has_a_cell_for_each_pair(tmp_path):
    material = read_material(finished_output(tmp_path / "out", Output(has_model=False)))
    cells = cells_of(match_matrix(material))
    assert cells.shape == (9, 9, 4)
    neighbours = np.abs(np.subtract.outer(np.arange(9), np.arange(9))) == 1
    np.testing.assert_array_equal(cells[..., 3] > 0, neighbours)


def test_the_matrix_of_many_photos_stays_small(tmp_path, monkeypatch):
    monkeypatch.setattr("sfm_front.reports.html.match_matrix._MOST_CELLS", 4)
    material = read_material(finished_output(tmp_path / "out", Output(has_model=False)))
    assert cells_of(match_matrix(material)).shape == (3, 3, 4)


def test_distributions_say_what_is_in_the_model(tmp_path):
    material = read_material(finished_output(tmp_path / "out"))
    observations = material.observations
    lengths = observations.track_lengths
    assert f"mean {lengths.mean():.1f}" in track_lengths(observations)
    drawing = reprojection_errors(observations)
    counts = [int(count) for count in re.findall(r"<title>(\d+)</title>", drawing)]
    assert sum(counts) == len(observations.point)
    # Noise of half a pixel along each axis: the median of a Rayleigh distribution.
    median = float(re.search(r"median ([\d.]+) px", drawing)[1])
    assert median == pytest.approx(0.5 * np.sqrt(2 * np.log(2)), rel=0.1)


def test_what_the_lens_does_is_seen_over_the_photo(tmp_path):
    """Keypoints shifted to the right in the left half, and to the left in the right one."""
    names = [f"{n}.png" for n in range(12)]
    model = exact_model(names=names)
    width = model.cameras[1].width
    for image in model.images.values():
        for point in image.points2D:
            if point.has_point3D():
                point.xy += np.array([1.0 if point.xy[0] < width / 2 else -1.0, 0])
    drawing = residual_grid(model, observations_of(model, model_folder(tmp_path, model)), 1)
    arrows = re.findall(r'd="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)', drawing)
    assert len(arrows) > 10
    middle = 260
    for x1, _, x2, _ in arrows:
        if abs(float(x1) - middle) > 40:  # away from cells that have both
            assert (float(x2) > float(x1)) == (float(x1) < middle)
    assert "largest 1.00 px" in drawing


def test_a_camera_of_few_photos_has_no_grid(tmp_path):
    model = exact_model(names=("a.png", "b.png"))
    folder = model_folder(tmp_path, model)
    assert residual_grid(pycolmap.Reconstruction(folder), observations_of(model, folder), 1) is None


def test_the_nearer_disc_hides_the_farther():
    at = np.array([[20.0, 15.0], [22.0, 15.0]])
    for depths, middle in (([1.0, 2.0], (255, 0, 0)), ([2.0, 1.0], (0, 0, 255))):
        drawn = reduced(splat(at, np.array(depths), np.array([RED, BLUE]), (40, 30), 3.0))
        assert drawn.size == (40, 30)
        assert drawn.getpixel((21, 15)) == (*middle, 255)
        assert drawn.getpixel((5, 5))[3] == 0


def test_what_is_off_the_picture_is_left_out():
    at = np.array([[-50.0, 10.0], [500.0, 10.0], [10.0, -2.0]])
    drawn = splat(at, np.ones(3), np.array([RED, RED, BLUE]), (40, 30), 3.0)
    pixels = np.array(drawn).reshape(-1, 4)
    assert {tuple(p) for p in pixels[pixels[:, 3] > 0].tolist()} == {(0, 0, 255, 255)}


def cells_of(drawing: str) -> np.ndarray:
    data = re.search(r'data:image/png;base64,([^"]+)', drawing)[1]
    return np.array(Image.open(BytesIO(b64decode(data))))

"""Where things are drawn: plan, arrows, overlap."""

from __future__ import annotations

import re
from base64 import b64decode
from io import BytesIO

import numpy as np
import pytest
from helpers.report_making import OFFSET_M, Output, finished_output
from PIL import Image

from sfm_front.reports.html.ground import ground_of, scale_bar, sheet_around
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.material_reading import read_material
from sfm_front.reports.html.overlap import overlap
from sfm_front.reports.html.plan import plan

ROUNDED_PX = 0.02


@pytest.fixture(scope="module")
def material(tmp_path_factory) -> Material:
    return read_material(finished_output(tmp_path_factory.mktemp("plans") / "out"))


def numbers(pattern: str, drawing: str) -> np.ndarray:
    return np.array([[*map(float, found)] for found in re.findall(pattern, drawing)])


def test_photos_are_drawn_where_they_are(material):
    drawing = plan(material)
    dots = numbers(r'cx="([\d.]+)" cy="([\d.]+)" r="[\d.]+" class="placed"', drawing)
    east_north = material.observations.centres[:, :2]
    assert len(dots) == len(east_north) == 8
    # One scale, east to the right, north up.
    drawn, true = dots - dots[0], (east_north - east_north[0]) * [1, -1]
    far = np.argmax(np.linalg.norm(true, axis=1))
    scale = np.linalg.norm(drawn[far]) / np.linalg.norm(true[far])
    np.testing.assert_allclose(drawn, scale * true, atol=ROUNDED_PX)


def test_a_photo_in_no_model_is_where_its_position_has_it(material):
    drawing = plan(material)
    (dot,) = numbers(r'cx="([\d.]+)" cy="([\d.]+)" r="[\d.]+" class="missing"', drawing)
    placed = numbers(r'cx="([\d.]+)" cy="([\d.]+)" r="[\d.]+" class="placed"', drawing)
    centres = material.observations.centres
    scale = np.linalg.norm(placed[1] - placed[0]) / np.linalg.norm((centres[1] - centres[0])[:2])
    there = material.measured_enu()[9][:2]
    expected = placed[0] + scale * (there - centres[0, :2]) * [1, -1]
    np.testing.assert_allclose(dot, expected, atol=10 * ROUNDED_PX)


def test_arrows_point_from_the_photo_to_its_position(material):
    drawing = plan(material)
    times = float(re.search(r"([\d.]+) times as long", drawing)[1])
    arrows = numbers(r'd="M([\d.]+) ([\d.]+)L([\d.]+) ([\d.]+)', drawing)
    placed = numbers(r'cx="([\d.]+)" cy="([\d.]+)" r="[\d.]+" class="placed"', drawing)
    np.testing.assert_allclose(arrows[:, :2], placed, atol=ROUNDED_PX)
    along = arrows[:, 2:] - arrows[:, :2]
    centres = material.observations.centres
    scale = np.linalg.norm(placed[1] - placed[0]) / np.linalg.norm((centres[1] - centres[0])[:2])
    expected = np.array([OFFSET_M[0], -OFFSET_M[1]]) * times * scale
    np.testing.assert_allclose(along, np.tile(expected, (8, 1)), atol=10 * ROUNDED_PX)


def test_heights_that_are_not_known_stay_unknown(material):
    measured = material.measured_enu()
    expected = material.observations.centres + OFFSET_M
    np.testing.assert_allclose([measured[i] for i in range(1, 9)], expected, atol=1e-3)


def test_overlap_counts_photos(material):
    drawing = overlap(material)
    cells = np.array(Image.open(BytesIO(b64decode(re.search('png;base64,([^"]+)', drawing)[1]))))
    # Six in ten of neighbours overlap along the strip: all is seen by two and more, most by more.
    assert {tuple(color) for color in cells[cells[..., 3] > 0][:, :3].tolist()} > {(202, 60, 60)}
    assert (cells[..., 3] > 0).mean() > 0.3
    enough = float(re.search(r"(\d+)% of what is seen", drawing)[1])
    lengths = material.observations.track_lengths
    assert 0 < enough < 100
    assert lengths.max() >= 5


def test_few_points_have_no_overlap(material, monkeypatch):
    monkeypatch.setattr("sfm_front.reports.html.overlap._NUM_CELLS", (10**6, 10**7))
    assert overlap(material) is None


def test_without_north_photos_look_up_in_the_plan(tmp_path):
    out = finished_output(tmp_path / "out", Output(sidecar=None))
    observations = read_material(out).observations
    ground = ground_of(observations, is_enu=False)
    np.testing.assert_allclose(ground.axes @ ground.axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(ground.axes) == pytest.approx(1)
    # They look down; what is above them is towards the reader.
    assert (ground.axes[2] @ observations.world_from_cam[:, :, 2].T < 0).all()
    assert plan(read_material(out)).count('class="placed"') == 8
    assert 'class="north"' not in plan(read_material(out))


@pytest.mark.parametrize("extent", [0.3, 40.0, 7000.0])
def test_the_scale_bar_is_as_long_as_it_says(extent):
    sheet = sheet_around(np.array([[0, 0], [extent, extent / 2]]))
    drawn = scale_bar(sheet)
    length_px = float(re.search(r"h([\d.]+)", drawn)[1])
    value, unit = re.search(r">([\d.]+) (k?m)<", drawn).groups()
    metres = float(value) * (1000 if unit == "km" else 1)
    assert length_px * sheet.unit == pytest.approx(metres, rel=1e-3)
    assert 0.05 * sheet.width < length_px < 0.5 * sheet.width


def test_all_that_is_framed_is_on_the_sheet():
    corners = np.array([[-5.0, 3.0], [8.0, 4.0], [1.0, 100.0]])
    sheet = sheet_around(corners)
    pixels = sheet.pixels(corners)
    assert (pixels > 0).all()
    assert (pixels < [sheet.width, sheet.height]).all()

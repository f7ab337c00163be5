"""Local frames: axes, way back, and what metres they give."""

from __future__ import annotations

import numpy as np
import pytest

from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.types import GeoPosition

FRAME = LocalFrame(52.0, 5.0, 40.0)


def test_its_origin_is_zero() -> None:
    assert np.allclose(FRAME.to_enu(np.array([[52.0, 5.0, 40.0]])), 0, atol=1e-6)


def test_axes_point_east_north_and_up() -> None:
    enu = FRAME.to_enu(np.array([[52.0, 5.001, 40.0], [52.001, 5.0, 40.0], [52.0, 5.0, 43.0]]))
    # A degree at 52 N on WGS84: 68 678 m of longitude, 111 267 m of latitude.
    assert enu[0] == pytest.approx([68.68, 0, 0], abs=0.05)
    assert enu[1] == pytest.approx([0, 111.27, 0], abs=0.05)
    assert enu[2] == pytest.approx([0, 0, 3], abs=1e-6)


def test_the_way_back_is_exact() -> None:
    enu = np.array([[1200.0, -800.0, 90.0], [-3.0, 2.0, -1.0]])
    assert np.allclose(FRAME.to_enu(FRAME.to_wgs84(enu)), enu, atol=1e-5)


def test_of_an_unknown_altitude_only_up_is_not_known() -> None:
    place = GeoPosition(52.001, 5.001)
    enu = FRAME.to_enu(lat_lon_alt([place, GeoPosition(52.001, 5.001, 40.0)]))
    assert np.isnan(enu[0, 2])
    np.testing.assert_array_equal(enu[0, :2], enu[1, :2])

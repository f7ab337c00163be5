"""Reference systems → WGS84: by pyproj, and never by halves."""

from __future__ import annotations

import sys

import numpy as np
import pycolmap
import pytest

from sfm_front.errors import DependencyError, InputError
from sfm_front.photos.crs import looks_like_crs, to_wgs84

ZURICH = (47.3769, 8.5417, 408.0)
# Of UTM coordinates that are rounded to millimetres, in degrees.
TOLERANCE_DEG = 2e-8


def utm(place: tuple[float, float, float]) -> np.ndarray:
    """COLMAP's own transformation, (1, 3) in the place's zone."""
    transform = pycolmap.GPSTransform(pycolmap.GPSTransformEllipsoid.WGS84)
    return np.round(np.asarray(transform.ellipsoid_to_utm(np.array([place]))[0]), 3)


@pytest.mark.parametrize(
    "name",
    [
        "EPSG:4326",
        "epsg:4979",
        "WGS84",
        "WGS 84",
        "+proj=longlat +datum=WGS84 +no_defs",
        "'+proj=latlong +ellps=WGS84 +datum=WGS84 +no_defs=True'",
    ],
)
def test_wgs84_needs_no_pyproj(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setitem(sys.modules, "pyproj", None)
    given = np.array([[8.5, 47.25, 400.0], [-70.0, -33.0, np.nan]])
    expected = np.array([[47.25, 8.5, 400.0], [-33.0, -70.0, np.nan]])
    np.testing.assert_array_equal(to_wgs84(name)(given), expected)


def test_others_do_and_say_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(DependencyError, match=r'pip install "sfm-front\[geo\]"'):
        to_wgs84("EPSG:25832")


def test_a_line_that_is_meant_as_one_is_told_from_others() -> None:
    for line in ("EPSG:4326", "epsg:1", "WGS84 UTM 32N", "WGS 84", "+proj=utm +zone=1"):
        assert looks_like_crs(line)
    for line in ("name,lat,lon", "a.jpg 8 47", "image x y"):
        assert not looks_like_crs(line)


class TestWithPyproj:
    @pytest.fixture(autouse=True)
    def _pyproj(self) -> None:
        pytest.importorskip("pyproj", reason="the extra geo is not installed")

    @pytest.mark.parametrize(
        "name",
        ["EPSG:32632", "WGS84 UTM 32N", "wgs 84 / utm zone 32n", "+proj=utm +zone=32 +datum=WGS84"],
    )
    def test_utm_north(self, name: str) -> None:
        found = to_wgs84(name)(utm(ZURICH))
        np.testing.assert_allclose(found[0, :2], ZURICH[:2], atol=TOLERANCE_DEG)
        assert found[0, 2] == ZURICH[2]

    def test_utm_south(self) -> None:
        sydney = (-33.8568, 151.2153, 12.0)
        found = to_wgs84("WGS84 UTM 56S")(utm(sydney))
        np.testing.assert_allclose(found[0], sydney, atol=TOLERANCE_DEG)

    def test_a_height_that_is_not_known_stays_so(self) -> None:
        xyz = np.concatenate([utm(ZURICH), utm(ZURICH)])
        xyz[0, 2] = np.nan
        found = to_wgs84("EPSG:25832")(xyz)
        assert np.isnan(found[0, 2])
        assert found[1, 2] == ZURICH[2]
        np.testing.assert_allclose(found[0, :2], ZURICH[:2], atol=1e-5)

    @pytest.mark.parametrize(
        ("name", "grid"),
        [
            ("EPSG:27700", "uk_os_OSTN15"),  # the place
            ("EPSG:25832+7837", "de_bkg_gcg2016"),  # the heights
            ("EPSG:32632+5773", "us_nga_egm96_15"),
        ],
    )
    def test_a_grid_that_is_missing_is_named(self, name: str, grid: str) -> None:
        import pyproj

        if pyproj.network.is_network_enabled():
            pytest.skip("PROJ fetches grids here")
        with pytest.raises(InputError, match=f"{grid}.* or convert the coordinates"):
            to_wgs84(name)

    @pytest.mark.parametrize("name", ["EPSG:99999", "EPSG:", "+proj=nonsense", "WGS84 UTM 99N"])
    def test_what_is_no_system_is_refused(self, name: str) -> None:
        with pytest.raises(InputError, match="no reference system that PROJ knows"):
            to_wgs84(name)

    def test_geocentric_coordinates_are_refused(self) -> None:
        with pytest.raises(InputError, match="neither geographic nor projected"):
            to_wgs84("EPSG:4978")

    def test_heights_beside_feet_are_in_nobody_knows_what(self) -> None:
        transform = to_wgs84("+proj=utm +zone=32 +datum=WGS84 +units=us-ft")
        in_feet = utm(ZURICH) / (1200 / 3937)
        with pytest.raises(InputError, match="does not say what heights are in"):
            transform(in_feet)
        in_feet[:, 2] = np.nan
        np.testing.assert_allclose(transform(in_feet)[0, :2], ZURICH[:2], atol=TOLERANCE_DEG)

    def test_coordinates_that_are_nowhere_are_refused(self) -> None:
        with pytest.raises(InputError, match="PROJ cannot transform these coordinates"):
            to_wgs84("EPSG:25832")(np.array([[1e30, 1e30, 0.0]]))

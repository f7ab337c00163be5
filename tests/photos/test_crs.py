import sys
import warnings

import pytest

from sfm_front.errors import DependencyError, InputError
from sfm_front.photos.crs import Crs, looks_like_crs
from sfm_front.types import GeoPosition


@pytest.mark.parametrize(
    "text", ["WGS84", " wgs84 ", "EPSG:4326", "epsg:4326", "+proj=longlat +datum=WGS84 +no_defs"]
)
def test_plain_wgs84_goes_without_pyproj(text, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    assert Crs.parse(text).to_wgs84(9.5, 48.25, 300.0) == GeoPosition(48.25, 9.5, 300.0)


def test_anything_else_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(DependencyError, match=r"UTM 32N need pyproj: pip install .*\[geo\]"):
        Crs.parse("WGS84 UTM 32N")


@pytest.mark.parametrize(("x", "y"), [(48.0, 109.0), (float("nan"), 0.0), (float("inf"), 0.0)])
def test_a_place_that_does_not_exist_is_refused(x, y):
    with pytest.raises(InputError, match="no place in EPSG:4326"):
        Crs.parse("EPSG:4326").to_wgs84(x, y)


def test_a_height_that_is_no_number_is_refused():
    with pytest.raises(InputError, match="height nan"):
        Crs.parse("WGS84").to_wgs84(9.0, 48.0, float("nan"))


class TestWithPyproj:
    @pytest.fixture(autouse=True)
    def _needs_pyproj(self):
        pytest.importorskip("pyproj")

    @pytest.mark.parametrize(
        "text",
        ["EPSG:32632", "WGS84 UTM 32N", "WGS_84 UTM 32N", "+proj=utm +zone=32 +datum=WGS84"],
    )
    def test_utm(self, text):
        # On the central meridian the northing is 0.9996 times the arc of the meridian: 4984944.378
        # metres up to 45° (WGS84).
        position = Crs.parse(text).to_wgs84(500_000, 0.9996 * 4_984_944.378)
        assert position.longitude_deg == pytest.approx(9, abs=1e-9)
        assert position.latitude_deg == pytest.approx(45, abs=1e-8)
        assert position.altitude_m is None

    def test_the_southern_hemisphere(self):
        position = Crs.parse("WGS84 UTM 33S").to_wgs84(500_000, 10_000_000)
        assert (position.latitude_deg, position.longitude_deg) == pytest.approx((0, 15), abs=1e-9)

    @pytest.mark.parametrize("text", ["EPSG:25832", "EPSG:25832+5783", "EPSG:4937"])
    def test_heights_are_never_converted(self, text):
        place = (9.0, 48.0) if text == "EPSG:4937" else (500_000, 5_300_000)
        assert Crs.parse(text).to_wgs84(*place, 123.25).altitude_m == 123.25

    def test_heights_where_x_counts_in_feet_are_refused(self):
        feet = Crs.parse("EPSG:2225")
        with pytest.raises(InputError, match="US survey foot"):
            feet.to_wgs84(6_500_000, 2_000_000, 300.0)

    def test_a_missing_grid_is_named(self):
        from pyproj.transformer import TransformerGroup

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if TransformerGroup("EPSG:27700", "EPSG:4326").best_available:
                pytest.skip("this machine has the grid")
        with pytest.raises(InputError, match=r"needs a grid .*OSTN15.*pyproj sync"):
            Crs.parse("EPSG:27700").to_wgs84(400_000, 300_000)

    def test_a_system_without_a_datum_is_refused(self):
        bessel = "+proj=tmerc +lat_0=0 +lon_0=9 +x_0=3500000 +ellps=bessel +units=m"
        with pytest.raises(InputError, match="does not say where it lies"):
            Crs.parse(bessel).to_wgs84(3_500_000, 5_400_000)
        shifted = f"{bessel} +towgs84=598.1,73.7,418.2,0.202,0.045,-2.455,6.7"
        assert Crs.parse(shifted).to_wgs84(3_500_000, 5_400_000).latitude_deg > 48

    def test_the_ellipsoid_of_today_will_do_without_a_datum(self):
        position = Crs.parse("+proj=utm +zone=32 +ellps=GRS80").to_wgs84(500_000, 0)
        assert (position.latitude_deg, position.longitude_deg) == pytest.approx((0, 9), abs=1e-9)

    @pytest.mark.parametrize(
        "text", ["", "nonsense", "EPSG:99999", "WGS84 UTM 61N", "EPSG:4978", "EPSG:5703"]
    )
    def test_what_is_no_horizontal_system_is_refused_in_one_line(self, text):
        with pytest.raises(InputError, match=r"Known are EPSG:4326") as caught:
            Crs.parse(text)
        assert "\n" not in str(caught.value)


def test_a_line_that_is_meant_as_one_is_told_from_others() -> None:
    for line in ("EPSG:4326", "epsg:1", "WGS84 UTM 32N", "WGS 84", "+proj=utm +zone=1"):
        assert looks_like_crs(line)
    for line in ("name,lat,lon", "a.jpg 8 47", "image x y"):
        assert not looks_like_crs(line)

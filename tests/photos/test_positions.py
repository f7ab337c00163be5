"""Where a photo's position comes from: EXIF, a row of a file, or nowhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from sfm_front.errors import ConfigError, InputError
from sfm_front.photos.positions import PositionOptions, PositionSource
from sfm_front.types import Exif, GeoPosition

WRITTEN = GeoPosition(47.0, 8.0, 500.0, 3.0)
EXIF = Exif(position=WRITTEN)


def source(folder: Path, *names: str) -> PositionSource:
    """Of a file with rows of these names; that of row n is at latitude n, from 1."""
    rows = "".join(f"{name},{latitude},0\n" for latitude, name in enumerate(names, start=1))
    file = folder / "positions.csv"
    file.write_text("name,lat,lon\n" + rows)
    return PositionSource(PositionOptions(source=str(file)))


def row_of(positions: PositionSource, name: str) -> int | None:
    """Which row a photo takes, from 1; None for EXIF."""
    position = positions.position_of(name, EXIF)
    assert position is not None
    return None if position == WRITTEN else round(position.latitude_deg)


def test_exif_is_taken_unless_it_is_off() -> None:
    assert PositionSource(PositionOptions()).position_of("a.jpg", EXIF) == WRITTEN
    assert PositionSource(PositionOptions()).position_of("a.jpg", Exif()) is None
    assert PositionSource(PositionOptions(source="off")).position_of("a.jpg", EXIF) is None


def test_a_file_counts_for_the_photos_that_it_names(tmp_path: Path) -> None:
    positions = source(tmp_path, "a.jpg", "b.jpg", "elsewhere.jpg")
    assert [row_of(positions, name) for name in ("b.jpg", "c.jpg", "a.jpg")] == [2, None, 1]
    assert row_of(positions, "a.jpg") == 1
    assert positions.position_of("d.jpg", Exif()) is None
    assert (positions.num_rows, positions.num_unused) == (3, 1)


@pytest.mark.parametrize(
    ("row", "photo"),
    [
        ("A.JPG", "a.jpg"),
        ("a.jpg", "flight/a.jpg"),
        ("flight/a.jpg", "added/flight/a.jpg"),
        ("/home/me/flight/a.jpg", "flight/a.jpg"),
        ("C:\\Flight\\a.jpg", "a.jpg"),
    ],
)
def test_one_name_may_be_the_end_of_the_other(tmp_path: Path, row: str, photo: str) -> None:
    assert row_of(source(tmp_path, "z.jpg", row), photo) == 2


def test_the_end_of_a_name_is_whole_folders(tmp_path: Path) -> None:
    positions = source(tmp_path, "x/a.jpg", "1.jpg")
    assert row_of(positions, "y/a.jpg") is None
    assert row_of(positions, "xx/a.jpg") is None
    assert row_of(positions, "img_1.jpg") is None


def test_the_longest_name_counts(tmp_path: Path) -> None:
    positions = source(tmp_path, "a.jpg", "x/a.jpg")
    assert [row_of(positions, name) for name in ("y/a.jpg", "x/a.jpg")] == [1, 2]


def test_a_name_that_two_rows_end_with_is_none(tmp_path: Path) -> None:
    positions = source(tmp_path, "x/a.jpg", "y/a.jpg")
    assert row_of(positions, "a.jpg") is None
    assert row_of(positions, "y/a.jpg") == 2


def test_a_row_is_for_one_photo(tmp_path: Path) -> None:
    positions = source(tmp_path, "a.jpg")
    assert [row_of(positions, name) for name in ("x/a.jpg", "y/a.jpg", "x/a.jpg")] == [1, None, 1]


def test_a_file_is_read_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        PositionSource(PositionOptions(source=str(tmp_path / "none.csv")))


def test_standard_deviations_are_ours_where_nobody_else_has_one() -> None:
    options = PositionOptions(horizontal_sigma_m=2.0, vertical_sigma_m=4.0)
    assert options.with_sigmas(WRITTEN) == GeoPosition(47.0, 8.0, 500.0, 3.0, 4.0)
    exact = GeoPosition(47.0, 8.0, None, 0.01, 0.02)
    assert options.with_sigmas(exact) == exact
    assert options.with_sigmas(GeoPosition(1, 2)) == GeoPosition(1, 2, None, 2.0, 4.0)


@pytest.mark.parametrize("value", [0.0, -1.0, float("inf"), float("nan")])
@pytest.mark.parametrize("name", ["horizontal_sigma_m", "vertical_sigma_m"])
def test_an_accuracy_that_cannot_be_is_refused(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=name):
        PositionOptions(**{name: value})


def test_no_source_is_refused() -> None:
    with pytest.raises(ConfigError, match="exif, off or a file"):
        PositionOptions(source="")

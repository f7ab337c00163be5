"""Contact sheets and match drawings: what is where, in which colour, and what cannot be written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageFont

from sfm_front.errors import InputError
from sfm_front.viewers import contact_sheet as sheets
from sfm_front.viewers import match_drawing, pictures
from sfm_front.viewers.contact_sheet import SheetRow, Tile, contact_sheet
from sfm_front.viewers.match_drawing import draw_matches

RED, GREEN, BLUE = (200, 30, 30), (30, 160, 60), (40, 60, 200)


@pytest.fixture
def plain(tmp_path):
    """Makes photos of one colour."""

    def make(name: str, color: tuple[int, int, int], size: tuple[int, int] = (400, 300)) -> Path:
        Image.new("RGB", size, color).save(tmp_path / name)
        return tmp_path / name

    return make


def count(pixels: np.ndarray, color: tuple[int, int, int]) -> int:
    return int(np.count_nonzero((pixels == color).all(axis=2)))


def extent(pixels: np.ndarray, color: tuple[int, int, int]) -> tuple[int, int, int, int]:
    """Left, top, right, bottom of the pixels of this colour."""
    rows, columns = np.nonzero((pixels == color).all(axis=2))
    return columns.min(), rows.min(), columns.max() + 1, rows.max() + 1


def tile(path: Path, *, wrong: bool = False) -> Tile:
    return Tile(path, path.name, "cosine 0.5", wrong=wrong)


def test_the_query_is_left_of_what_was_found_in_its_order(plain):
    found = [tile(plain("g.png", GREEN)), tile(plain("b.png", BLUE))]
    pixels = np.asarray(contact_sheet([SheetRow(tile(plain("r.png", RED)), found)]))
    left = [extent(pixels, color)[0] for color in (RED, GREEN, BLUE)]
    assert left == sorted(left)
    query, first = extent(pixels, RED), extent(pixels, GREEN)
    assert query[2] - query[0] > 1.3 * (first[2] - first[0])
    assert count(pixels, pictures.WRONG) == 0


def test_ten_are_shown_in_two_lines_of_five(plain):
    gray = plain("gray.png", (128, 128, 128))
    found = [tile(gray)] * 5 + [tile(plain("g.png", GREEN))] + [tile(gray)] * 4
    found += [tile(plain("b.png", BLUE))]
    pixels = np.asarray(contact_sheet([SheetRow(tile(plain("r.png", RED)), found)]))
    assert count(pixels, GREEN) > 1000
    assert count(pixels, BLUE) == 0
    assert extent(pixels, GREEN)[1] > pixels.shape[0] // 2


def test_only_wrong_photos_are_framed_red_and_all_around(plain):
    found = [tile(plain("g.png", GREEN)), tile(plain("b.png", BLUE), wrong=True)]
    sheet = contact_sheet([SheetRow(tile(plain("r.png", RED)), found)])
    pixels = np.asarray(sheet)
    inside = extent(pixels, BLUE)
    frame = pixels[: inside[3] + sheets._THICK]
    assert extent(frame, pictures.WRONG) == (
        inside[0] - sheets._THICK,
        inside[1] - sheets._THICK,
        inside[2] + sheets._THICK,
        inside[3] + sheets._THICK,
    )


def test_queries_are_below_each_other(plain):
    rows = [
        SheetRow(tile(plain("r.png", RED)), [tile(plain("x.png", (9, 9, 9)))]),
        SheetRow(tile(plain("b.png", BLUE)), []),
    ]
    one, two = contact_sheet(rows[:1]), contact_sheet(rows)
    assert two.width == one.width
    assert two.height > 1.9 * one.height
    pixels = np.asarray(two)
    assert extent(pixels, RED)[3] < extent(pixels, BLUE)[1]


@pytest.mark.parametrize("size", [(900, 100), (100, 900), (64, 64)])
def test_photos_of_any_shape_keep_it(plain, size):
    pixels = np.asarray(
        contact_sheet([SheetRow(tile(plain("r.png", RED)), [tile(plain("g.png", GREEN, size))])])
    )
    left, top, right, bottom = extent(pixels, GREEN)
    assert (right - left) / (bottom - top) == pytest.approx(size[0] / size[1], rel=0.05)


def test_a_photo_that_is_gone_does_not_stop_the_sheet(plain, tmp_path):
    found = [tile(tmp_path / "gone.png")]
    contact_sheet([SheetRow(tile(plain("r.png", RED)), found)])


def test_long_names_lose_their_middle():
    font = ImageFont.load_default(17)
    short = pictures.shortened("a" * 100 + "_end.jpg", 200, font)
    assert short.startswith("a")
    assert "..." in short
    assert short.endswith("_end.jpg")
    assert font.getlength(short) <= 200
    assert pictures.shortened("b.jpg", 200, font) == "b.jpg"


@pytest.mark.parametrize("text", ["plain.jpg", "süd/straße.jpg", "写真.jpg", "a\nb"])
def test_any_name_is_written_within_its_width(text, monkeypatch):
    for fonts in (pictures._SYSTEM_FONTS, ()):
        monkeypatch.setattr(pictures, "_SYSTEM_FONTS", fonts)
        pictures._system_font.cache_clear()
        picture = Image.new("RGB", (300, 60), (255, 255, 255))
        pictures.write(picture, text, (150, 5), size=17, ink=(0, 0, 0), width=200, anchor="ma")
        columns = np.nonzero((np.asarray(picture) < 128).any(axis=(0, 2)))[0]
        assert 45 < columns.min() < columns.max() < 255


SIZES = ((400, 300), (300, 400))


def drawn(
    plain, xy1: list[list[float]], xy2: list[list[float]], is_inlier: list[bool] | None = None
) -> np.ndarray:
    black, white = plain("0.png", (0, 0, 0)), plain("1.png", (255, 255, 255), (300, 400))
    shape = -1, 2
    points = np.array(xy1, float).reshape(shape), np.array(xy2, float).reshape(shape)
    inlier = None if is_inlier is None else np.array(is_inlier)
    return np.asarray(draw_matches(black, white, *points, SIZES, "caption", inlier))


def test_outliers_are_grey_and_inliers_coloured(plain):
    ends = [[200, 50], [200, 250]], [[150, 50], [150, 350]]
    pixels = drawn(plain, *ends, [True, False]).astype(int)
    left_photo = pixels[:, match_drawing._MARGIN + 5 : pixels.shape[1] // 3]
    middle = len(pixels) // 2
    upper, lower = left_photo[match_drawing._CAPTION + 5 : middle], left_photo[middle:-30]

    def colourfulness(part: np.ndarray) -> int:
        return int((part.max(axis=2) - part.min(axis=2)).max())

    assert colourfulness(upper) > 50
    assert lower.max() > 50
    assert colourfulness(lower) == 0


def test_a_line_runs_from_point_to_point(plain):
    """Without a match nothing is drawn on the photos; with one, changes lie on its line."""
    empty = drawn(plain, [], [])
    pixels = drawn(plain, [[200, 150]], [[150, 200]])
    left, top, right, bottom = extent(empty, (0, 0, 0))
    # Both points are the centres of their photos.
    start = np.array([(left + right) / 2, (top + bottom) / 2])
    second_left = right + match_drawing._GAP
    second_width = pixels.shape[1] - match_drawing._MARGIN - second_left
    end = np.array([second_left + second_width / 2, top + match_drawing.HEIGHT / 2])
    rows, columns = np.nonzero((pixels != empty).any(axis=2))
    along = (end - start) / np.linalg.norm(end - start)
    away = np.stack([columns, rows], axis=1) + 0.5 - start
    assert np.abs(away @ [-along[1], along[0]]).max() < 6
    reach = away @ along
    assert reach.min() == pytest.approx(0, abs=6)
    assert reach.max() == pytest.approx(np.linalg.norm(end - start), abs=6)


def test_lines_are_coloured_by_height(plain):
    pixels = drawn(plain, [[100, 5], [100, 295]], [[100, 5], [100, 395]]).astype(int)
    left_photo = pixels[:, match_drawing._MARGIN + 5 : pixels.shape[1] // 3]
    middle = len(pixels) // 2
    upper, lower = left_photo[match_drawing._CAPTION + 5 : middle], left_photo[middle:-30]
    strongest = [part.reshape(-1, 3).max(axis=0).argmax() for part in (upper, lower)]
    assert strongest == [0, 2]  # red, blue


def test_of_very_many_matches_a_share_has_lines_and_all_have_points(plain):
    rng = np.random.default_rng(0)
    xy1 = np.column_stack([rng.uniform(0, 100, 3000), rng.uniform(0, 300, 3000)])
    crowd = drawn(plain, xy1.tolist(), (xy1 * (1, 4 / 3)).tolist())
    # Right of all points only lines are left, and photo shows between them.
    strip = crowd[60:-60, 700:720]
    assert count(strip, (0, 0, 0)) > 0.2 * strip.shape[0] * strip.shape[1]


@pytest.mark.parametrize(("name", "kind"), [("a.png", "PNG"), ("b.JPG", "JPEG")])
def test_pictures_are_written_by_their_names(tmp_path, name, kind):
    pictures.save(Image.new("RGB", (20, 10)), tmp_path / "new" / name)
    with Image.open(tmp_path / "new" / name) as picture:
        assert (picture.format, picture.size) == (kind, (20, 10))


def test_a_picture_of_unknown_kind_is_a_mistake(tmp_path):
    with pytest.raises(InputError, match=r"a\.tiff: pictures are written as"):
        pictures.save(Image.new("RGB", (20, 10)), tmp_path / "a.tiff")

from pathlib import Path

import pytest

from sfm_front.errors import InputError
from sfm_front.georeference.control.marks import PhotoMark, check_photos, marks_in_photos
from sfm_front.georeference.control.point_file import ControlPoint, Mark
from sfm_front.types import GeoPosition


def point(photo, x=99.0, y=49.0):
    return ControlPoint("a", GeoPosition(48, 9), (Mark(photo, x, y, 7),))


def test_pixels_are_counted_from_a_corner():
    marks, missing = marks_in_photos([point("a.jpg")], {"a.jpg": (400, 300)})
    assert marks == [PhotoMark("a", "a.jpg", 99.5, 49.5)]
    assert missing == []


def test_marks_of_larger_photos_are_scaled_down_also_in_turned_ones():
    for size in ((400, 300), (300, 400)):
        marks, _ = marks_in_photos([point("a.jpg", 399.5, 199.5)], {"a.jpg": size}, (1600, 1200))
        assert (marks[0].x, marks[0].y) == (100, 50)


def test_photos_are_found_below_folders_in_any_case():
    marks, missing = marks_in_photos(
        [point("A.JPG"), point("b.jpg")], {"day1/a.jpg": (400, 300), "day2/c.jpg": (400, 300)}
    )
    assert [mark.photo for mark in marks] == ["day1/a.jpg"]
    assert missing == ["b.jpg"]


def test_a_name_that_fits_two_photos_is_refused_unless_it_is_whole():
    sizes = {"day1/a.jpg": (400, 300), "day2/a.jpg": (400, 300)}
    with pytest.raises(InputError, match=r"line 7 .* may be day1/a.jpg or day2/a.jpg"):
        marks_in_photos([point("a.jpg")], sizes)
    marks, _ = marks_in_photos([point("day2/a.jpg")], sizes)
    assert marks[0].photo == "day2/a.jpg"


def test_a_mark_outside_its_photo_says_how_to_mend_it():
    with pytest.raises(InputError, match=r"line 7 .* outside a.jpg, .* --gcp-size W,H"):
        marks_in_photos([point("a.jpg", 400)], {"a.jpg": (400, 300)})


def test_a_size_of_another_shape_is_refused():
    with pytest.raises(InputError, match="another shape than the 1600 x 900"):
        marks_in_photos([point("a.jpg")], {"a.jpg": (400, 300)}, (1600, 900))


def test_enough_of_the_photos_given_must_have_marks():
    points = [
        ControlPoint(
            name, GeoPosition(48, 9), (Mark("a.jpg", 1, 1, 2), Mark("b.jpg", 1, 1, 3)), name == "c"
        )
        for name in "abcd"
    ]
    check_photos(Path("gcp.txt"), points, ["day/a.jpg", "day/b.jpg"])
    with pytest.raises(InputError, match=r"gcp.txt: 0 control points .* b.jpg, for one, is not"):
        check_photos(Path("gcp.txt"), points, ["day/a.jpg", "day/c.jpg"])

import pytest

from sfm_front.errors import InputError
from sfm_front.georeference.control.point_file import Mark, read_control_points

POINTS = ("9.000 48.000 300.5", "9.001 48.000 301", "9.000 48.001 302")


def write(tmp_path, *lines, crs="EPSG:4326"):
    path = tmp_path / "gcp_list.txt"
    path.write_text("\n".join([crs, *lines]) + "\n", encoding="utf-8")
    return path


def triangle(*, names=("a", "b", "c"), points=POINTS, extra=""):
    """Two marks of each of three points."""
    return [
        f"{point} 10 {20 + photo} photo{photo}.jpg {name} {extra}".strip()
        for point, name in zip(points, names, strict=True)
        for photo in (1, 2)
    ]


def test_points_and_marks_are_read(tmp_path):
    first, second, _ = read_control_points(write(tmp_path, "# comment", "", *triangle()))
    assert (first.name, first.is_checkpoint) == ("a", False)
    assert first.position.longitude_deg == 9.0
    assert first.position.latitude_deg == 48.0
    assert first.position.altitude_m == 300.5
    assert first.position.horizontal_sigma_m is None
    assert first.marks == (Mark("photo1.jpg", 10, 21, 4), Mark("photo2.jpg", 10, 22, 5))
    assert second.name == "b"


def test_lines_without_a_name_belong_together_by_their_coordinates(tmp_path):
    lines = [*triangle(names=("", "", "")), f"{POINTS[0]} 1 2 photo3.jpg top"]
    points = read_control_points(write(tmp_path, *lines))
    assert [point.name for point in points] == ["top", "line 4", "line 6"]
    assert [len(point.marks) for point in points] == [3, 2, 2]


def test_tabs_allow_for_blanks_in_names(tmp_path):
    lines = [f"{POINTS[0]} 5 6".replace(" ", "\t") + "\tmy photo.jpg\tthe point", *triangle()]
    first, *_ = read_control_points(write(tmp_path, *lines, crs="EPSG:4326\t"))
    assert first.name == "the point"
    assert first.marks[0].photo == "my photo.jpg"


def test_a_suffix_or_a_column_makes_a_checkpoint(tmp_path):
    more = ["9.002 48.002 300 1 1 photo1.jpg d_check", "9.003 48.002 300 1 1 photo1.jpg e check"]
    points = read_control_points(write(tmp_path, *triangle(), *more))
    assert [point.name for point in points if point.is_checkpoint] == ["d_check", "e"]


def test_two_numbers_after_the_name_are_standard_deviations(tmp_path):
    points = read_control_points(write(tmp_path, *triangle(extra="0.01 0.025 check?")))
    assert points[0].position.horizontal_sigma_m == 0.01
    assert points[0].position.vertical_sigma_m == 0.025
    points = read_control_points(write(tmp_path, *triangle(extra="red 0.025")))
    assert points[0].position.horizontal_sigma_m is None


@pytest.mark.parametrize("missing", ["nan", "-", "None", "0", "0.0"])
def test_heights_that_are_not_known(tmp_path, missing):
    points = tuple(point.rsplit(" ", 1)[0] + f" {missing}" for point in POINTS)
    read = read_control_points(write(tmp_path, *triangle(points=points)))
    assert [point.position.altitude_m for point in read] == [None] * 3
    read = read_control_points(write(tmp_path, *triangle(points=(points[0], *POINTS[1:]))))
    assert [point.position.altitude_m for point in read] == [None, 301, 302]


def test_a_height_of_zero_by_the_sea_is_one(tmp_path):
    points = ("9.000 48.000 0.0", "9.001 48.000 3", "9.000 48.001 -2")
    read = read_control_points(write(tmp_path, *triangle(points=points)))
    assert [point.position.altitude_m for point in read] == [0, 3, -2]


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("9 48 300 10", "line 8: 4 columns; expected x y z px py photo"),
        ("9 48 high 10 20 a.jpg", "line 8: z is 'high', not a number"),
        ("9 48 300 inf 20 a.jpg", "line 8: px is 'inf', not a number"),
        ("48 109 300 10 20 a.jpg", "line 8: .* no place in EPSG:4326"),
        ("9 48 300 10 20 photo3.jpg a", "line 8: a has other coordinates than in line 2"),
        (f"{POINTS[0]} 11 20 photo1.jpg a", "line 8: .* another mark in photo1.jpg, in line 2"),
    ],
)
def test_mistakes_are_named_with_their_line(tmp_path, line, message):
    path = write(tmp_path, *triangle(), line)
    with pytest.raises(InputError, match=message) as caught:
        read_control_points(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_mark_that_stands_twice_is_one(tmp_path):
    lines = triangle()
    points = read_control_points(write(tmp_path, *lines, lines[0]))
    assert len(points[0].marks) == 2


@pytest.mark.parametrize(
    ("crs", "message"),
    [
        ("nonsense crs", "line 1: .*reference system"),
        (triangle()[0], "line 1: the first line must name the reference system"),
    ],
)
def test_the_first_line_must_be_a_reference_system(tmp_path, crs, message):
    if crs.startswith("nonsense"):
        pytest.importorskip("pyproj")
    with pytest.raises(InputError, match=message):
        read_control_points(write(tmp_path, *triangle(), crs=crs))


def test_a_file_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_control_points(tmp_path / "none.txt")
    (tmp_path / "empty.txt").touch()
    with pytest.raises(InputError, match="empty"):
        read_control_points(tmp_path / "empty.txt")


def test_fewer_than_three_control_points_are_refused(tmp_path):
    names = ("a", "b", "c_check")
    with pytest.raises(InputError, match=r"2 control points .* at least 3 are needed"):
        read_control_points(write(tmp_path, *triangle(names=names)))
    with pytest.raises(InputError, match="2 control points with marks in two photos"):
        read_control_points(write(tmp_path, *triangle()[:-1]))


def test_points_on_a_line_are_refused(tmp_path):
    points = ("9.000 48.000 300", "9.001 48.001 310", "9.002 48.002 290")
    with pytest.raises(InputError, match="on a line"):
        read_control_points(write(tmp_path, *triangle(points=points)))

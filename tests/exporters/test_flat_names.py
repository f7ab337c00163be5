"""Names that no reader stumbles over."""

from __future__ import annotations

import pytest

from sfm_front.exporters.flat_names import flat_stems


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("0001.jpg", "0001"),
        ("IMG_12-a.JPG", "IMG_12-a"),
        ("left/0001.jpg", "left_0001"),
        ("a b.jpg", "a_b"),
        ('"quoted".png', "_quoted_"),
        ("a.b.c.jpg", "a_b_c"),
        ("../../etc/passwd.jpg", "______etc_passwd"),
        ("/absolute.jpg", "_absolute"),
        ("..", "__"),
        ("-rf.jpg", "_rf"),
        ("café.jpg", "cafe"),
        ("cafe\u0301.jpg", "cafe"),
        ("写真.jpg", "__"),
        ("a\n\x1b[31m.jpg", "a___31m"),
        ("", "photo"),
        ("x" * 300 + ".jpg", "x" * 80),
    ],
)
def test_a_name_becomes_plain(name, stem):
    assert flat_stems([name]) == {name: stem}


def test_no_two_are_alike():
    names = ["a/1.jpg", "a_1.jpg", "a 1.jpg", "A_1.JPG", "a_1.png", "a_1_2.jpg", "写.jpg", "真.jpg"]
    stems = flat_stems(names)
    assert set(stems) == set(names)
    assert len({stem.lower() for stem in stems.values()}) == len(names)
    assert stems["a/1.jpg"] == "a_1"

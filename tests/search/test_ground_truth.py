"""Files of relevant photos: names, pairs, and both kinds of mistakes."""

from __future__ import annotations

from pathlib import Path

import pytest

from sfm_front.errors import InputError
from sfm_front.search.ground_truth import GroundTruth, read_ground_truth

PHOTOS = ["a.jpg", "b.jpg", "c.jpg", "my photo 3.jpg", "flight 1 20"]


def read(tmp_path: Path, text: str) -> GroundTruth:
    file = tmp_path / "truth.txt"
    file.write_text(text, encoding="utf-8")
    return read_ground_truth(file, PHOTOS)


def test_names_are_relevant_to_every_query(tmp_path):
    truth = read(tmp_path, "# comment\n\na.jpg\n  my photo 3.jpg\nelsewhere.jpg\n")
    assert truth.of("any.jpg") == {"a.jpg", "my photo 3.jpg"}
    assert truth.of("a.jpg") == {"my photo 3.jpg"}


def test_pairs_hold_both_ways(tmp_path):
    truth = read(tmp_path, "a.jpg b.jpg 20\nc.jpg a.jpg 31\n# a.jpg b.jpg 5\n")
    assert truth.of("a.jpg") == {"b.jpg", "c.jpg"}
    assert truth.of("b.jpg") == {"a.jpg"}


def test_of_a_photo_that_no_pair_has_nothing_is_known(tmp_path):
    assert read(tmp_path, "a.jpg b.jpg 20\n").of("c.jpg") is None


def test_a_photo_whose_name_looks_like_a_pair_is_a_photo(tmp_path):
    assert read(tmp_path, "flight 1 20\n").of("a.jpg") == {"flight 1 20"}


@pytest.mark.parametrize("text", ["", "x.jpg\n", "x.jpg y.jpg 40\n", "a.jpg b.jpg\n"])
def test_a_file_that_names_no_photo_is_a_mistake(tmp_path, text):
    with pytest.raises(InputError, match="names none of the 5 photos"):
        read(tmp_path, text)


def test_a_file_that_cannot_be_read_is_a_mistake(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_ground_truth(tmp_path / "missing.txt", PHOTOS)
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InputError, match="not text in UTF-8"):
        read_ground_truth(tmp_path / "binary", PHOTOS)

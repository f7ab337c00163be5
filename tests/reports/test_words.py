"""Numbers, times and names as people read them."""

from __future__ import annotations

import pytest

from sfm_front.reports.words import capitalized, day_and_hour, one_line


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("süd ✈\tb.jpg", "süd ✈\tb.jpg"),
        ("a\nAll photos are in one model.jpg", "a\\x0aAll photos are in one model.jpg"),
        ("a\r\x0b\x85\u2028b", "a\\x0d\\x0b\\x85\\x2028b"),
    ],
)
def test_a_name_does_not_begin_a_line_of_its_own(name, expected):
    assert one_line(name) == expected
    assert len(one_line(name).splitlines()) == 1


def test_a_moment_is_said_in_the_time_of_the_world():
    assert day_and_hour(0.0) == "00:00:00 UTC on 1 January"
    assert day_and_hour(1_796_071_416.4) == "20:43:36 UTC on 30 November"


def test_a_sentence_begins_with_a_capital_and_stays_otherwise():
    assert capitalized("to go on: sfm-front R") == "To go on: sfm-front R"
    assert capitalized("") == ""

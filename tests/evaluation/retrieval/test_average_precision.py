"""Average precision by the official definitions, on cases worked by hand."""

from __future__ import annotations

import pytest

from sfm_front.evaluation.retrieval.average_precision import assess, average_precision, recall_at
from sfm_front.evaluation.retrieval.types import Query

EXACT = 1e-12


def query(relevant, ignored=""):
    return Query("q", "q", frozenset(relevant), frozenset(ignored))


@pytest.mark.parametrize(
    ("ranking", "relevant", "ignored", "expected"),
    [
        ("abx", "ab", "", 1),
        # a at rank 1: (1 + 1) / 2 wide 1/2. b at 3, precision 1/2 before and 2/3 after.
        ("axb", "ab", "", (1 + (1 / 2 + 2 / 3) / 2) / 2),
        # The first answer is wrong: precision before a is 0, not 1.
        ("xa", "a", "", (0 + 1 / 2) / 2),
        ("xxab", "ab", "", ((0 + 1 / 3) / 2 + (1 / 3 + 2 / 4) / 2) / 2),
        ("xyz", "a", "", 0),
        ("", "a", "", 0),
        # What is not in the ranking is never found.
        ("a", "ab", "", 1 / 2),
        # Junk is passed over wherever it stands.
        ("jajb", "ab", "j", 1),
        ("jxjajkbk", "ab", "jk", ((0 + 1 / 2) / 2 + (1 / 2 + 2 / 3) / 2) / 2),
    ],
)
def test_worked_by_hand(ranking, relevant, ignored, expected):
    found = average_precision(ranking, set(relevant), set(ignored))
    assert found == pytest.approx(expected, abs=EXACT)


def test_the_order_of_wrong_answers_after_the_last_right_one_does_not_matter():
    first = average_precision("axbcyz", set("abc"))
    assert first == average_precision("axbczy", set("abc"))
    assert first < average_precision("abcxyz", set("abc"))


def test_recall_counts_what_is_among_the_first():
    assert recall_at(1, "axb", set("ab")) == 1 / 2
    assert recall_at(3, "axb", set("ab")) == 1
    assert recall_at(10, "axb", set("abc")) == 2 / 3
    # More are relevant than asked for: it cannot reach 1.
    assert recall_at(5, "abcdef", set("abcdefghij")) == 1 / 2


def test_means_are_over_queries_with_something_to_find():
    queries = [query("ab"), query("c", "x"), query("")]
    accuracy = assess(["axb", "xyc", "abc"], queries)
    expected = ((1 + (1 / 2 + 2 / 3) / 2) / 2 + (0 + 1 / 2) / 2) / 2
    assert accuracy.num_queries == 2
    assert accuracy.mean_average_precision == pytest.approx(expected, abs=EXACT)
    assert accuracy.first_right == 1 / 2
    assert accuracy.recall == {5: 1, 10: 1, 25: 1}


def test_junk_takes_no_place_among_the_first_answers():
    accuracy = assess(["jjjjja"], [query("a", "j")])
    assert accuracy.first_right == 1
    assert accuracy.recall[5] == 1


def test_nothing_to_find_is_no_accuracy():
    assert assess(["abc"], [query("")]) is None

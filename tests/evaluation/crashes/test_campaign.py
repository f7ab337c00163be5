"""A run that was struck is compared with one that was not."""

from __future__ import annotations

import pytest

from sfm_front.evaluation.crashes.campaign import Result, compare

UNDISTURBED = Result(frozenset({"a.jpg", "b.jpg"}), (0.7, 0.9, 0.95))


def test_as_good_is_no_violation():
    assert compare(UNDISTURBED, UNDISTURBED) == []
    assert compare(Result(UNDISTURBED.registered, (0.696, 0.896, 0.946)), UNDISTURBED) == []


def test_a_photo_that_is_lost_is_named():
    lost = Result(frozenset({"a.jpg"}), UNDISTURBED.auc)
    assert compare(lost, UNDISTURBED) == ["not registered after all: b.jpg"]


@pytest.mark.parametrize(("index", "threshold"), [(0, 1), (1, 3), (2, 5)])
def test_poses_that_are_worse_are_noticed_at_each_threshold(index, threshold):
    worse = list(UNDISTURBED.auc)
    worse[index] -= 0.006
    (found,) = compare(Result(UNDISTURBED.registered, tuple(worse)), UNDISTURBED)
    assert found.startswith(f"pose AUC at {threshold} degrees")


def test_without_known_poses_photos_alone_count():
    known = Result(UNDISTURBED.registered, ())
    assert compare(known, known) == []

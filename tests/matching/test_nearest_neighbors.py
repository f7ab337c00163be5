"""Matching against brute force written out in numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.matching.in_plane_rotation import RotationOptions
from sfm_front.matching.match_mask import MaskBlock, MatchMask
from sfm_front.matching.nearest_neighbors import (
    MatchingOptions,
    match_descriptors,
    match_masked,
    match_rotated,
)
from sfm_front.types import Features


def brute_force(
    first: NDArray[np.uint8],
    second: NDArray[np.uint8],
    options: MatchingOptions,
    apart: NDArray[np.bool_] | None = None,
) -> NDArray[np.int64]:
    """(K, 2): the angle of the nearest is small enough, and small beside the second nearest's."""
    cosine = (first.astype(np.int64) @ second.astype(np.int64).T) / 512.0**2
    if apart is not None:
        cosine[apart] = 0
    rows = []
    for i in range(len(first)):
        best, next_best = np.argsort(-cosine[i], kind="stable")[:2]
        nearest, next_nearest = np.arccos(np.minimum(cosine[i, [best, next_best]], 1))
        if (
            nearest <= options.max_angle_rad
            and nearest < options.max_ratio * next_nearest
            and cosine[:, best].argmax() == i
        ):
            rows.append((i, best))
    return np.array(rows, dtype=np.int64).reshape(-1, 2)


@pytest.fixture(scope="module")
def neighbours() -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Descriptors of two photos that overlap in part, some of them blurred a good deal."""
    scene = make_scene(10, 400, seed=3)
    rng = np.random.default_rng(0)
    first, second = (scene.photo(index).features.descriptors for index in (4, 5))
    blur = rng.normal(0, 1, second.shape) * rng.uniform(0, 50, (len(second), 1))
    blurred = np.maximum(second + blur, 0)
    blurred *= 512 / np.linalg.norm(blurred, axis=1, keepdims=True)
    return first, np.minimum(np.rint(blurred), 255).astype(np.uint8)


@pytest.mark.parametrize(
    "options",
    [
        MatchingOptions(),
        MatchingOptions(max_ratio=0.6),
        MatchingOptions(max_ratio=1.0),
        MatchingOptions(max_angle_rad=0.3),
        MatchingOptions(max_ratio=1.0, max_angle_rad=3.0),
    ],
    ids=["default", "strict ratio", "no ratio", "small angle", "mutual only"],
)
def test_it_equals_brute_force(neighbours, options):
    matches = match_descriptors(*neighbours, options)
    assert matches.dtype == np.uint32
    assert len(matches) > 30
    np.testing.assert_array_equal(matches, brute_force(*neighbours, options))


def test_every_test_takes_matches_away(neighbours):
    """Else equality with brute force would not show that each of them is applied."""
    counts = [
        len(match_descriptors(*neighbours, options))
        for options in (
            MatchingOptions(max_ratio=1.0, max_angle_rad=3.0),
            MatchingOptions(max_ratio=1.0),
            MatchingOptions(),
            MatchingOptions(max_angle_rad=0.3),
        )
    ]
    assert counts == sorted(counts, reverse=True)
    assert len(set(counts)) == len(counts)


def test_rows_rise_and_no_keypoint_is_matched_twice(neighbours):
    matches = match_descriptors(*neighbours, MatchingOptions(max_ratio=1.0, max_angle_rad=3.0))
    assert (np.diff(matches[:, 0].astype(int)) > 0).all()
    assert len(np.unique(matches[:, 1])) == len(matches)


def test_two_that_answer_alike_are_ambiguous(neighbours):
    descriptors = neighbours[0][:50]
    repeated = np.concatenate([descriptors, descriptors[:10]])
    matches = match_descriptors(descriptors, repeated, MatchingOptions())
    np.testing.assert_array_equal(matches, np.arange(10, 50)[:, None].repeat(2, axis=1))


@pytest.mark.parametrize(("count1", "count2"), [(0, 5), (5, 0), (1, 5), (5, 1), (0, 0)])
def test_too_few_to_compare_give_no_matches(count1, count2):
    rng = np.random.default_rng(0)
    first, second = (rng.integers(0, 90, (n, 128), dtype=np.uint8) for n in (count1, count2))
    assert match_descriptors(first, second, MatchingOptions()).shape == (0, 2)


def test_strangers_do_not_match():
    first, second = (make_scene(1, 300, seed=seed).photo(0) for seed in (1, 2))
    matches = match_descriptors(
        first.features.descriptors, second.features.descriptors, MatchingOptions()
    )
    assert len(matches) < 0.02 * len(first.features)


def test_a_strided_selection_of_descriptors_is_fine(neighbours):
    first, second = (np.ascontiguousarray(d[::2]) for d in neighbours)
    np.testing.assert_array_equal(
        match_descriptors(neighbours[0][::2], neighbours[1][::2], MatchingOptions()),
        match_descriptors(first, second, MatchingOptions()),
    )


def test_of_those_that_meet_it_equals_brute_force(neighbours):
    first, second = neighbours
    options = MatchingOptions(max_ratio=0.9)
    rng = np.random.default_rng(1)
    order1, order2 = rng.permutation(len(first)), rng.permutation(len(second))[:-20]
    meet = rng.random((len(order1), len(order2))) < 0.5
    half = len(order1) // 2
    even, every = np.arange(0, len(order2), 2), slice(0, len(order2))
    blocks = (
        MaskBlock(slice(0, half), even, meet[:half, even]),
        MaskBlock(slice(half, len(order1)), every, meet[half:]),
    )
    found = match_masked(first, second, MatchMask(order1, order2, blocks), options)

    apart = np.ones((len(first), len(second)), np.bool_)
    apart[np.ix_(order1[:half], order2[even])] = ~meet[:half, even]
    apart[np.ix_(order1[half:], order2)] = ~meet[half:]
    expected = brute_force(first, second, options, apart)
    assert len(expected) > 20
    np.testing.assert_array_equal(found, expected)


def oriented(descriptors: NDArray[np.uint8], orientations: NDArray[np.float64]) -> Features:
    keypoints = np.zeros((len(descriptors), 4), np.float32)
    keypoints[:, 3] = orientations
    return Features(keypoints, descriptors, np.zeros((len(descriptors), 3), np.uint8))


def test_where_all_are_turned_alike_it_is_matching_as_before(neighbours):
    turned = [
        oriented(part, np.full(len(part), angle))
        for part, angle in zip(neighbours, (1, 3), strict=True)
    ]
    found = match_rotated(*turned, 2.0, MatchingOptions())
    assert found.dtype == np.uint32
    np.testing.assert_array_equal(found, match_descriptors(*neighbours, MatchingOptions()))


def test_only_those_turned_alike_match(neighbours):
    first, second = neighbours
    matches = match_descriptors(first, second, MatchingOptions())
    rng = np.random.default_rng(0)
    orientations = rng.uniform(0, 2 * np.pi, len(first))
    turned = rng.uniform(0, 2 * np.pi, len(second))
    turned[matches[:, 1]] = orientations[matches[:, 0]] + 2.5
    opposed = matches[::2]
    turned[opposed[:, 1]] += np.pi
    photos = oriented(first, orientations), oriented(second, turned)
    found = {tuple(row) for row in match_rotated(*photos, 2.5, MatchingOptions()).tolist()}
    assert {tuple(row) for row in matches[1::2].tolist()} <= found
    assert not found & {tuple(row) for row in opposed.tolist()}


def test_how_far_a_feature_may_deviate_from_the_rotation_is_an_option(neighbours):
    photos = [
        oriented(part, np.full(len(part), angle))
        for part, angle in zip(neighbours, (0, np.deg2rad(50)), strict=True)
    ]
    loose = MatchingOptions(rotation=RotationOptions(tolerance_deg=60))
    assert len(match_rotated(*photos, 0.0, MatchingOptions())) == 0
    np.testing.assert_array_equal(
        match_rotated(*photos, 0.0, loose), match_descriptors(*neighbours, MatchingOptions())
    )


def test_a_second_nearest_that_is_turned_elsewhere_does_not_make_it_ambiguous(neighbours):
    descriptors = neighbours[0][:50]
    repeated = np.concatenate([descriptors, descriptors])
    photos = (
        oriented(descriptors, np.zeros(50)),
        oriented(repeated, np.repeat([0.0, np.pi], 50)),
    )
    matches = match_rotated(*photos, 0.0, MatchingOptions())
    np.testing.assert_array_equal(matches, np.arange(50)[:, None].repeat(2, axis=1))
    assert len(match_descriptors(descriptors, repeated, MatchingOptions())) == 0


@pytest.mark.parametrize(("count1", "count2"), [(0, 5), (5, 0), (1, 5), (0, 0)])
def test_too_few_to_compare_give_no_matches_either_way(count1, count2):
    rng = np.random.default_rng(0)
    photos = [
        oriented(rng.integers(0, 90, (n, 128), dtype=np.uint8), np.zeros(n))
        for n in (count1, count2)
    ]
    assert match_rotated(*photos, 0.0, MatchingOptions()).shape == (0, 2)


@pytest.mark.parametrize("wrong", [{"max_ratio": 0.0}, {"max_ratio": 1.1}, {"max_angle_rad": 0.0}])
def test_values_out_of_range_are_refused_by_name(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        MatchingOptions(**wrong)

"""Matchers against each other: threads, and torch in one batch, here on the CPU."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.photo_stream import no_features

from sfm_front.evaluation.synthetic.scene import make_scene
from sfm_front.matching.in_plane_rotation import RotationOptions
from sfm_front.matching.matcher import CpuMatcher, make_matcher
from sfm_front.matching.nearest_neighbors import MatchingOptions, match_descriptors, match_rotated
from sfm_front.matching.torch_matcher import TorchMatcher
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import Features

OPTIONS = MatchingOptions()
TURNS_RAD = [None, 0.1, 3.1, None]


@pytest.fixture(scope="module")
def photos() -> list[Features]:
    scene = make_scene(6, 300, seed=8)
    return [scene.photo(index).features for index in range(5)]


@pytest.mark.parametrize("num_threads", [1, 3])
def test_each_pair_is_matched_as_it_is_alone(photos, num_threads):
    query, *others = photos
    with WorkerPool(num_threads) as workers:
        matcher = CpuMatcher(OPTIONS, workers)
        everything = matcher.match(query, others, [None] * len(others))
        found = matcher.match(query, others, TURNS_RAD)
    assert len(everything[0]) > 50
    for matches, other in zip(everything, others, strict=True):
        np.testing.assert_array_equal(
            matches, match_descriptors(query.descriptors, other.descriptors, OPTIONS)
        )
    np.testing.assert_array_equal(found[0], everything[0])
    np.testing.assert_array_equal(found[1], match_rotated(query, others[1], 0.1, OPTIONS))


@pytest.mark.parametrize("rotation", [RotationOptions(), RotationOptions(tolerance_deg=60)])
@pytest.mark.parametrize("at_once", [2**29, 2000])
def test_torch_finds_the_same(photos, at_once, rotation, monkeypatch):
    monkeypatch.setattr("sfm_front.matching.torch_matcher._MAX_SIMILARITIES", at_once)
    query, *others = photos
    others = [*others[:3], others[3].largest(40)]
    options = MatchingOptions(rotation=rotation)
    torch_matcher = TorchMatcher(options, "cpu")
    with WorkerPool(1) as workers:
        cpu_matcher = CpuMatcher(options, workers)
        for rotations_rad in ([None] * len(others), TURNS_RAD):
            expected = cpu_matcher.match(query, others, rotations_rad)
            found = torch_matcher.match(query, others, rotations_rad)
            assert sum(map(len, expected)) > 50
            for theirs, ours in zip(expected, found, strict=True):
                assert ours.dtype == np.uint32
                np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("rotation_rad", [None, 1.0])
def test_photos_without_features_match_nothing_anywhere(photos, rotation_rad):
    empty = no_features()
    with WorkerPool(1) as workers:
        for matcher in (CpuMatcher(OPTIONS, workers), TorchMatcher(OPTIONS, "cpu")):
            assert matcher.match(photos[0], [], []) == []
            for query, other in ((photos[0], empty), (empty, photos[0]), (empty, empty)):
                (matches,) = matcher.match(query, [other], [rotation_rad])
                assert matches.shape == (0, 2)


def test_the_device_chooses():
    with WorkerPool(1) as workers:
        assert isinstance(make_matcher("cpu", OPTIONS, workers), CpuMatcher)
        assert isinstance(make_matcher("cuda", OPTIONS, workers), TorchMatcher)

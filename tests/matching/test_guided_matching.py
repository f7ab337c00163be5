"""Pairs of photos whose poses are known, on a flight with known overlaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import true_matches, true_pair, view_of

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.matching.guided_matching import GuidedMatcher, GuidedOptions, two_view_geometry
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.matching.verification import VerificationOptions
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import PairGeometry, RankedCandidate, View

QUERY, NEAR, NEXT = 0, 1, 2
MIN_RECALL = 0.9
MAX_WRONG = 0.05
ANGLE_TOLERANCE = 0.02


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(12, 600, seed=5, layout="orbit")


@pytest.fixture(scope="module")
def views(orbit) -> dict[int, View]:
    return {index: view_of(orbit, index, index) for index in (QUERY, NEAR, NEXT)}


@pytest.fixture(scope="module")
def truth(orbit) -> dict[int, PosedCamera]:
    return {i: PosedCamera(orbit.camera, orbit.cams_from_world[i]) for i in (QUERY, NEAR, NEXT)}


@pytest.fixture
def guided():
    with WorkerPool(1) as workers:
        yield GuidedMatcher(GuidedOptions(), MatchingOptions(), VerificationOptions(), workers)


def looked_at(scene: SyntheticScene, index: int, count: int = 40) -> RankedCandidate:
    """A candidate that re-ranking found so many true matches with."""
    matches = true_matches(scene, QUERY, index)[:count]
    return RankedCandidate(index, 0.5, len(matches), None, matches)


def test_it_finds_the_true_matches_and_the_true_geometry(orbit, views, truth, guided):
    candidates = [looked_at(orbit, NEAR), looked_at(orbit, NEXT)]
    pairs = guided.match(views[QUERY], truth[QUERY], candidates, views, truth)
    assert [(pair.image_id1, pair.image_id2) for pair in pairs] == [(QUERY, NEAR), (QUERY, NEXT)]
    for pair in pairs:
        true = {tuple(row) for row in true_matches(orbit, QUERY, pair.image_id2).tolist()}
        found = {tuple(row) for row in pair.two_view_geometry.inlier_matches.tolist()}
        assert len(found & true) > MIN_RECALL * len(true)
        assert len(found - true) < MAX_WRONG * len(found)
        assert len({first for first, _ in found}) == len({second for _, second in found})


def test_the_geometry_is_what_colmap_would_have_estimated(orbit, views, truth, guided):
    (pair,) = guided.match(views[QUERY], truth[QUERY], [looked_at(orbit, NEAR)], views, truth)
    geometry = pair.two_view_geometry
    expected = true_pair(orbit, QUERY, NEAR, (QUERY, NEAR)).two_view_geometry
    assert geometry.config == int(pycolmap.TwoViewGeometryConfiguration.CALIBRATED)
    assert np.linalg.norm(geometry.cam2_from_cam1.translation) == pytest.approx(1)
    direction = expected.cam2_from_cam1.translation
    np.testing.assert_allclose(
        geometry.cam2_from_cam1.translation, direction / np.linalg.norm(direction)
    )
    np.testing.assert_allclose(
        geometry.cam2_from_cam1.rotation.matrix(), expected.cam2_from_cam1.rotation.matrix()
    )
    assert geometry.tri_angle == pytest.approx(expected.tri_angle, abs=ANGLE_TOLERANCE)
    # x2' F x1 = 0, in pixels, where there is no distortion.
    pinhole = pycolmap.Camera.create_from_model_id(
        1, pycolmap.CameraModelId.PINHOLE, 900, 1600, 1200
    )
    straight = {i: PosedCamera(pinhole, posed.cam_from_world) for i, posed in truth.items()}
    seen = [orbit.cams_from_world[i] * orbit.points[:200] for i in (QUERY, NEAR)]
    first, second = (np.column_stack([pinhole.img_from_cam(x), np.ones(200)]) for x in seen)
    fundamental = two_view_geometry(straight[QUERY], straight[NEAR]).F
    lines = first @ fundamental.T
    off_px = np.einsum("ij,ij->i", second, lines) / np.linalg.norm(lines[:, :2], axis=1)
    assert np.abs(off_px).max() < 1e-6


def test_poses_that_the_evidence_contradicts_are_not_believed(orbit, views, truth, guided):
    pose = truth[QUERY].cam_from_world
    tilt = pycolmap.Rigid3d(pycolmap.Rotation3d([0.0, 0.05, 0.0]), [0.0, 0.0, 0.0])
    wrong = PosedCamera(truth[QUERY].camera, tilt * pose)
    assert guided.match(views[QUERY], wrong, [looked_at(orbit, NEAR)], views, truth) == []


@pytest.mark.parametrize("why", ["too little evidence", "no pose", "same place"])
def test_without_evidence_or_pose_there_is_no_pair(why, orbit, views, truth, guided):
    candidate, others = looked_at(orbit, NEAR), dict(truth)
    if why == "too little evidence":
        candidate = looked_at(orbit, NEAR, 14)
    elif why == "no pose":
        del others[NEAR]
    else:
        others[NEAR] = truth[QUERY]
    assert guided.match(views[QUERY], truth[QUERY], [candidate], views, others) == []


def test_matches_that_turn_otherwise_are_left_out(orbit, views, truth, guided):
    candidate = looked_at(orbit, NEAR)

    def inliers(rotation_rad: float | None) -> set[tuple[int, int]]:
        found = guided.match(
            views[QUERY],
            truth[QUERY],
            [replace(candidate, rotation_rad=rotation_rad)],
            views,
            truth,
        )
        (pair,) = found or (PairGeometry(0, 0, candidate.matches[:0], pycolmap.TwoViewGeometry()),)
        return {tuple(row) for row in pair.matches.tolist()}

    keypoints = [views[i].features.keypoints for i in (QUERY, NEAR)]
    pairs = true_matches(orbit, QUERY, NEAR)
    turn = np.median(keypoints[1][pairs[:, 1], 3] - keypoints[0][pairs[:, 0], 3])
    assert len(inliers(float(turn))) > MIN_RECALL * len(inliers(None))
    assert inliers(float(turn)) <= inliers(None)
    assert len(inliers(float(turn) + np.pi)) < MAX_WRONG * len(inliers(None))


def matches_with(views, truth, candidate: RankedCandidate, **options: float) -> np.ndarray:
    """(M, 2) matches of the query and the candidate; none if there is no pair."""
    with WorkerPool(1) as workers:
        guided = GuidedMatcher(
            GuidedOptions(**options), MatchingOptions(), VerificationOptions(), workers
        )
        pairs = guided.match(views[QUERY], truth[QUERY], [candidate], views, truth)
    return pairs[0].matches if pairs else np.zeros((0, 2), np.uint32)


def test_features_too_close_to_the_epipole_are_left_out(orbit, views, truth):
    candidate, min_sine = looked_at(orbit, NEAR), 0.9
    baseline = truth[NEAR].center - truth[QUERY].center
    found = matches_with(views, truth, candidate, min_baseline_sine=min_sine)
    assert 15 <= len(found) < len(matches_with(views, truth, candidate))
    for side, index in enumerate((QUERY, NEAR)):
        rays = truth[index].rays(views[index].features.keypoints[found[:, side]])
        across = np.linalg.norm(np.cross(rays, baseline / np.linalg.norm(baseline)), axis=1)
        assert across.min() >= min_sine - 1e-9


def test_how_far_a_match_may_deviate_from_the_rotation_is_an_option(orbit, views, truth):
    keypoints = [views[i].features.keypoints for i in (QUERY, NEAR)]
    pairs = true_matches(orbit, QUERY, NEAR)
    turn = float(np.median(keypoints[1][pairs[:, 1], 3] - keypoints[0][pairs[:, 0], 3]))
    candidate = replace(looked_at(orbit, NEAR), rotation_rad=turn)
    numbers = [
        len(matches_with(views, truth, candidate, rotation_tolerance_deg=tolerance))
        for tolerance in (10, 20, 180)
    ]
    assert 15 <= numbers[0] < numbers[1] < numbers[2]
    anyhow = replace(candidate, rotation_rad=None)
    assert numbers[2] == len(matches_with(views, truth, anyhow))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"max_ratio": 0.0}, "max_ratio must be above 0"),
        ({"min_agreeing": 1.1}, "min_agreeing must be above 0 and at most 1, got 1.1"),
        ({"min_baseline_sine": 0.0}, "min_baseline_sine must be above 0 and below 1, got 0.0"),
        ({"min_baseline_sine": 1.0}, "min_baseline_sine must be above 0 and below 1, got 1.0"),
        ({"rotation_tolerance_deg": 0.0}, "rotation_tolerance_deg must be above 0 and at most 180"),
        ({"rotation_tolerance_deg": 181.0}, "at most 180, got 181.0"),
    ],
)
def test_values_out_of_range_are_refused_by_name(wrong, message):
    with pytest.raises(ConfigError, match=message):
        GuidedOptions(**wrong)

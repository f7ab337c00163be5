"""Two-view verification on pairs with known truth."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import pycolmap
import pytest
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.geometry.rays import undistorted_rays
from sfm_front.matching.verification import VerificationOptions, Verifier
from sfm_front.types import Features, PairGeometry, Rejected, Rejection, View

WIDTH, HEIGHT = 1600, 1200
NOISE_PX = 0.5
RECALL = 0.97  # of the true matches
FALSE_SHARE = 0.02  # of what is accepted: strays that happen to lie on their epipolar line
FALSE_SHARE_ON_PLANE = 0.05  # a plane leaves the fundamental matrix free to take some along
ROTATION_DEG = 0.1
DIRECTION_DEG = 1.0
CONFIGURATION = pycolmap.TwoViewGeometryConfiguration


@dataclass(frozen=True)
class Pair:
    view1: View
    view2: View
    matches: NDArray[np.uint32]
    is_true: NDArray[np.bool_]
    cam2_from_cam1: pycolmap.Rigid3d


def make_camera() -> pycolmap.Camera:
    return pycolmap.Camera(
        camera_id=1,
        model="SIMPLE_RADIAL",
        width=WIDTH,
        height=HEIGHT,
        params=[1300.0, WIDTH / 2, HEIGHT / 2, -0.05],
    )


def view_at(image_id: int, xy: NDArray[np.float64]) -> View:
    count = len(xy)
    keypoints = np.column_stack([xy, np.full(count, 3.0), np.zeros(count)]).astype(np.float32)
    nothing = np.zeros((count, 128), np.uint8), np.zeros((count, 3), np.uint8)
    return View(image_id, make_camera(), Features(keypoints, *nothing))


def anywhere(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    return rng.random((count, 2)) * (WIDTH, HEIGHT)


def make_pair(
    num_true: int, num_false: int, *, seed: int = 0, flat: bool = False, turn_only: bool = False
) -> Pair:
    """Photos of points 6 to 14 m away, on a slanted plane if ``flat``, taken 1 m apart and turned
    by some degrees; keypoints and matches in random order."""
    rng = np.random.default_rng(seed)
    turn = pycolmap.Rotation3d(np.array([0.03, -0.08, 0.05]))
    translation = np.zeros(3) if turn_only else np.array([-1.0, 0.1, 0.2])
    cam2_from_cam1 = pycolmap.Rigid3d(turn, translation)
    camera = make_camera()
    found1, found2 = [], []
    while len(found1) < num_true:
        x, y = rng.uniform(-0.55, 0.55), rng.uniform(-0.4, 0.4)
        depth = 8 / (1 - 0.6 * x) if flat else rng.uniform(6, 14)
        point = depth * np.array([x, y, 1.0])
        xy1, xy2 = (camera.img_from_cam(p[None])[0] for p in (point, cam2_from_cam1 * point))
        if all(0 < v[0] < WIDTH and 0 < v[1] < HEIGHT for v in (xy1, xy2)):
            found1.append(xy1 + rng.normal(0, NOISE_PX, 2))
            found2.append(xy2 + rng.normal(0, NOISE_PX, 2))
    in1 = np.concatenate([np.array(found1).reshape(-1, 2), anywhere(rng, num_false)])
    in2 = np.concatenate([np.array(found2).reshape(-1, 2), anywhere(rng, num_false)])
    count = num_true + num_false
    # Keypoints of neither pair lie between: indices of matches are not 0, 1, 2, …
    place1, place2 = (rng.permutation(count + 100)[:count] for _ in range(2))
    all1, all2 = anywhere(rng, count + 100), anywhere(rng, count + 100)
    all1[place1], all2[place2] = in1, in2
    order = rng.permutation(count)
    matches = np.column_stack([place1, place2]).astype(np.uint32)[order]
    is_true = (np.arange(count) < num_true)[order]
    return Pair(view_at(7, all1), view_at(3, all2), matches, is_true, cam2_from_cam1)


def verified(pair: Pair, **options: float) -> PairGeometry:
    result = Verifier(VerificationOptions(**options)).verify(pair.view1, pair.view2, pair.matches)
    assert isinstance(result, PairGeometry), result
    return result


def accepted(pair: Pair, result: PairGeometry) -> NDArray[np.bool_]:
    """(M,) whether each match is among the inliers; every inlier must be one of the matches."""
    rows = {tuple(row) for row in result.two_view_geometry.inlier_matches.tolist()}
    assert rows <= {tuple(row) for row in pair.matches.tolist()}
    assert len(rows) == result.num_inliers
    return np.array([tuple(row) in rows for row in pair.matches.tolist()])


def assert_inliers_are_the_true_matches(
    pair: Pair, result: PairGeometry, false_share: float = FALSE_SHARE
) -> None:
    inside = accepted(pair, result)
    assert inside[pair.is_true].mean() > RECALL
    assert (inside & ~pair.is_true).sum() <= max(1, false_share * inside.sum())


def assert_pose_is_true(pair: Pair, found: pycolmap.Rigid3d) -> None:
    apart = found.rotation.inverse() * pair.cam2_from_cam1.rotation
    assert np.degrees(apart.angle()) < ROTATION_DEG
    directions = [
        pose.translation / np.linalg.norm(pose.translation) for pose in (found, pair.cam2_from_cam1)
    ]
    assert np.degrees(np.arccos(np.clip(directions[0] @ directions[1], -1, 1))) < DIRECTION_DEG


@pytest.mark.parametrize(("num_true", "num_false"), [(60, 0), (200, 60), (200, 200), (900, 300)])
def test_the_true_matches_and_the_true_pose_are_found(num_true, num_false):
    pair = make_pair(num_true, num_false)
    result = verified(pair)
    assert (result.image_id1, result.image_id2) == (7, 3)
    np.testing.assert_array_equal(result.matches, pair.matches)
    assert result.two_view_geometry.config == CONFIGURATION.CALIBRATED
    assert_inliers_are_the_true_matches(pair, result)
    assert_pose_is_true(pair, result.two_view_geometry.cam2_from_cam1)


def test_the_essential_matrix_holds_for_the_true_matches():
    pair = make_pair(300, 100, seed=1)
    essential = verified(pair).two_view_geometry.E
    true = pair.matches[pair.is_true]
    rays1, rays2 = (
        undistorted_rays(view.camera, view.points(indices))
        for view, indices in zip((pair.view1, pair.view2), true.T, strict=True)
    )
    lines = rays1 @ essential.T
    distance = np.abs(np.einsum("ij,ij->i", rays2, lines)) / np.linalg.norm(lines[:, :2], axis=1)
    # A normalised image plane: times the focal length it is in pixels.
    assert np.median(distance) * 1300 < 3 * NOISE_PX


def test_the_triangulation_angle_is_that_of_the_points():
    pair = make_pair(400, 50, seed=2)
    # The points are 10 m away and the photos about 1 m apart.
    assert np.degrees(verified(pair).two_view_geometry.tri_angle) == pytest.approx(5.7, abs=1.5)


def test_a_plane_is_verified():
    pair = make_pair(200, 60, flat=True)
    assert_inliers_are_the_true_matches(pair, verified(pair), FALSE_SHARE_ON_PLANE)


def test_a_camera_that_only_turned_is_verified():
    pair = make_pair(200, 60, turn_only=True)
    result = verified(pair)
    turned = CONFIGURATION.PANORAMIC, CONFIGURATION.PLANAR_OR_PANORAMIC
    assert result.two_view_geometry.config in turned
    assert accepted(pair, result)[pair.is_true].mean() > RECALL


@pytest.mark.parametrize("seed", range(5))
def test_random_matches_are_rejected(seed):
    pair = make_pair(0, 100, seed=seed)
    result = Verifier().verify(pair.view1, pair.view2, pair.matches)
    assert result.reason is Rejection.NO_EPIPOLAR_GEOMETRY


@pytest.mark.parametrize("count", [0, 1, 7, 14])
def test_fewer_matches_than_inliers_needed_are_rejected_at_once(count):
    pair = make_pair(count, 0)
    result = Verifier().verify(pair.view1, pair.view2, pair.matches)
    assert result.reason is Rejection.TOO_FEW_MATCHES


def test_a_watermark_is_no_overlap():
    rng = np.random.default_rng(0)
    stamp = np.array([20.0, 1120.0]) + rng.random((60, 2)) * (150, 60)
    view1, view2 = view_at(2, stamp), view_at(1, stamp + rng.normal(0, 0.2, stamp.shape))
    matches = np.arange(60, dtype=np.uint32)[:, None].repeat(2, axis=1)
    assert Verifier().verify(view1, view2, matches).reason is Rejection.WATERMARK


def test_min_inliers_is_obeyed():
    pair = make_pair(40, 20)
    assert isinstance(
        Verifier(VerificationOptions(min_inliers=30)).verify(pair.view1, pair.view2, pair.matches),
        PairGeometry,
    )
    assert isinstance(
        Verifier(VerificationOptions(min_inliers=50)).verify(pair.view1, pair.view2, pair.matches),
        Rejected,
    )


def test_max_error_is_in_pixels_of_the_photo():
    pair = make_pair(400, 0, seed=3)
    strict = verified(pair, max_error_px=0.5).num_inliers
    loose = verified(pair, max_error_px=3.0).num_inliers
    assert strict < 0.9 * loose
    assert loose > RECALL * 400


def test_a_sample_serves_as_well_as_all():
    pair = make_pair(900, 200, seed=4)
    sampled, full = (verified(pair, model_sample=n) for n in (100, 2000))
    assert_inliers_are_the_true_matches(pair, sampled)
    assert_inliers_are_the_true_matches(pair, full)
    assert_pose_is_true(pair, sampled.two_view_geometry.cam2_from_cam1)


def test_a_gate_that_is_less_sure_misses_more():
    pairs = [make_pair(100, 200, seed=seed) for seed in range(4)]

    def num_inliers(**options: float) -> int:
        verifier = Verifier(VerificationOptions(**options))
        return sum(verifier.count_inliers(p.view1, p.view2, p.matches) for p in pairs)

    assert num_inliers() > RECALL * 400
    assert num_inliers(gate_confidence=1e-9) < 0.8 * num_inliers()
    assert num_inliers(max_gate_trials=1) < 0.8 * num_inliers()


def test_more_trials_find_other_models():
    """Where few do not find the best one already, which is so for most pairs."""
    pairs = [make_pair(300, 300, seed=seed) for seed in (0, 6)]
    few, many = (
        [outcome(verified(pair, min_model_trials=count)) for pair in pairs] for count in (1, 10_000)
    )
    assert few != many


def test_the_essential_matrix_brings_back_what_the_gate_lost(monkeypatch):
    pair = make_pair(400, 100, seed=6)
    half = pair.is_true & (np.arange(500) % 2 == 0)
    monkeypatch.setattr(Verifier, "_gate", lambda *_: half)
    assert_inliers_are_the_true_matches(pair, verified(pair))


def test_count_inliers_counts_the_true_matches():
    pair = make_pair(200, 200, seed=5)
    assert Verifier().count_inliers(pair.view1, pair.view2, pair.matches) == pytest.approx(
        200, rel=0.05
    )
    for count in (0, 7):
        few = make_pair(count, 0)
        assert Verifier().count_inliers(few.view1, few.view2, few.matches) == 0
    stray = make_pair(0, 100)
    assert Verifier().count_inliers(stray.view1, stray.view2, stray.matches) < 15


def outcome(result: PairGeometry | Rejection) -> object:
    if isinstance(result, Rejected):
        return result
    geometry = result.two_view_geometry
    return (
        geometry.config,
        geometry.cam2_from_cam1.matrix().tobytes(),
        np.asarray(geometry.inlier_matches).tobytes(),
        geometry.tri_angle,
    )


def test_the_same_pair_gives_the_same_to_the_bit_on_any_thread():
    pairs = [make_pair(150, 150, seed=seed) for seed in range(4)] + [make_pair(0, 200)]
    verifier = Verifier()

    def run(pair: Pair) -> object:
        return outcome(verifier.verify(pair.view1, pair.view2, pair.matches))

    first = [run(pair) for pair in pairs]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(run, pairs * 2)) == first * 2
    assert [run(pair) for pair in reversed(pairs)] == first[::-1]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"max_error_px": 0.0}, "max_error_px must be above 0"),
        ({"min_inliers": 7}, "min_inliers must be at least 8"),
        ({"model_sample": 10}, r"model_sample must be at least min_inliers \(15\), got 10"),
        ({"max_gate_trials": 0}, "max_gate_trials must be at least 1, got 0"),
        ({"gate_confidence": 0.0}, "gate_confidence must be above 0 and below 1, got 0.0"),
        ({"gate_confidence": 1.0}, "gate_confidence must be above 0 and below 1, got 1.0"),
        ({"min_model_trials": 0}, "min_model_trials must be from 1 to 10000, got 0"),
        ({"min_model_trials": 10_001}, "min_model_trials must be from 1 to 10000, got 10001"),
        ({"max_error_px": float("nan")}, "max_error_px must be above 0, got nan"),
    ],
)
def test_values_out_of_range_are_refused(wrong, message):
    with pytest.raises(ConfigError, match=message):
        VerificationOptions(**wrong)

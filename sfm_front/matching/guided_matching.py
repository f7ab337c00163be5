"""Matches a photo whose pose in a model is known along epipolar planes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.matching.epipolar import EpipolarPlanes
from sfm_front.matching.in_plane_rotation import agrees_with_rotation
from sfm_front.matching.nearest_neighbors import MatchingOptions, match_masked
from sfm_front.matching.verification import CALIBRATED, VerificationOptions
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.types import Float64Array, PairGeometry, RankedCandidate, View


@dataclass(frozen=True, kw_only=True)
class GuidedOptions:
    """When poses are trusted, and which features may match under them."""

    # Largest ratio of the nearest neighbour's angle to the second nearest's in the epipolar band.
    # Stricter than among all features (TUNING: guided-ratio).
    max_ratio: float = 0.7
    # Share of the re-ranking inliers that must agree with the poses.
    min_agreeing: float = 0.8
    # Smallest sine of the angle between a feature's ray and the baseline; 0.05 is about 3 degrees.
    # Closer to an epipole, epipolar planes cannot be distinguished and there is hardly any
    # parallax.
    min_baseline_sine: float = 0.05
    # How far a match may deviate from the pair's in-plane rotation, in degrees.
    rotation_tolerance_deg: float = 30.0

    def __post_init__(self) -> None:
        if not 0 < self.max_ratio <= 1:
            raise ConfigError(f"max_ratio must be above 0 and at most 1, got {self.max_ratio}")
        if not 0 < self.min_agreeing <= 1:
            raise ConfigError(
                f"min_agreeing must be above 0 and at most 1, got {self.min_agreeing}"
            )
        if not 0 < self.min_baseline_sine < 1:
            raise ConfigError(
                f"min_baseline_sine must be above 0 and below 1, got {self.min_baseline_sine}"
            )
        if not 0 < self.rotation_tolerance_deg <= 180:
            raise ConfigError(
                "rotation_tolerance_deg must be above 0 and at most 180, "
                f"got {self.rotation_tolerance_deg}"
            )


class GuidedMatcher:
    """Takes the two-view geometry from the poses in the model, and matches accordingly.

    Poses may be wrong. They are trusted only if they agree with the matches of re-ranking, which
    were found without them.
    """

    def __init__(
        self,
        options: GuidedOptions,
        matching: MatchingOptions,
        verification: VerificationOptions,
        workers: WorkerPool,
    ) -> None:
        self._options = options
        self._matching = replace(matching, max_ratio=options.max_ratio)
        self._max_error_px = verification.max_error_px
        self._min_inliers = verification.min_inliers
        self._workers = workers

    def match(
        self,
        query: View,
        posed: PosedCamera,
        candidates: Sequence[RankedCandidate],
        views: Mapping[int, View],
        posed_others: Mapping[int, PosedCamera],
    ) -> list[PairGeometry]:
        """Pairs of the query with those candidates whose poses agree with their matches.

        ``posed``: the query's camera and pose; ``views`` and ``posed_others``: by image id. Without
        a known pose there is no pair.
        """
        first = _side(query, posed)

        def match_one(candidate: RankedCandidate) -> PairGeometry | None:
            other = posed_others.get(candidate.image_id)
            if other is None or candidate.inliers < self._min_inliers:
                return None
            return self._pair(first, _side(views[candidate.image_id], other), candidate)

        pairs = self._workers.map(match_one, candidates)
        return [pair for pair in pairs if pair is not None]

    def _pair(self, first: _Side, second: _Side, candidate: RankedCandidate) -> PairGeometry | None:
        """None if the re-ranking inliers contradict the poses or too few features match."""
        baseline = second.posed.center - first.posed.center
        if not baseline.any():
            return None
        planes = EpipolarPlanes(baseline, first.rays, second.rays)
        band_rad = self._max_error_px / second.posed.camera.mean_focal_length()
        agreeing = np.count_nonzero(planes.distances_rad(candidate.matches) <= band_rad)
        if agreeing < max(self._min_inliers, self._options.min_agreeing * candidate.inliers):
            return None
        features1, features2 = first.view.features, second.view.features
        matches = match_masked(
            features1.descriptors,
            features2.descriptors,
            planes.mask(band_rad, min_sine=self._options.min_baseline_sine),
            self._matching,
        )
        if candidate.rotation_rad is not None:
            keypoints1 = features1.keypoints[matches[:, 0]]
            keypoints2 = features2.keypoints[matches[:, 1]]
            agrees = agrees_with_rotation(
                keypoints1,
                keypoints2,
                candidate.rotation_rad,
                self._options.rotation_tolerance_deg,
            )
            matches = matches[agrees]
        if len(matches) < self._min_inliers:
            return None
        geometry = two_view_geometry(first.posed, second.posed)
        geometry.inlier_matches = matches
        rays1, rays2 = first.rays[matches[:, 0]], second.rays[matches[:, 1]]
        cosines = np.einsum("ij,ij->i", rays1, rays2)
        geometry.tri_angle = float(np.median(np.arccos(np.clip(cosines, -1, 1))))
        return PairGeometry(first.view.image_id, second.view.image_id, matches, geometry)


@dataclass(frozen=True, slots=True, eq=False)
class _Side:
    """One side of a pair; ``rays`` (N, 3): see ``PosedCamera.rays``."""

    view: View
    posed: PosedCamera
    rays: Float64Array


def _side(view: View, posed: PosedCamera) -> _Side:
    return _Side(view, posed, posed.rays(view.features.keypoints))


def two_view_geometry(posed1: PosedCamera, posed2: PosedCamera) -> pycolmap.TwoViewGeometry:
    """COLMAP's calibrated two-view geometry: the relative pose with a translation of length 1."""
    geometry = pycolmap.TwoViewGeometry()
    geometry.config = CALIBRATED
    pose = posed1.relative(posed2)
    pose.translation = pose.translation / np.linalg.norm(pose.translation)
    geometry.cam2_from_cam1 = pose
    geometry.E = pycolmap.essential_matrix_from_pose(pose)
    inverse1, inverse2 = (
        np.linalg.inv(posed.camera.calibration_matrix()) for posed in (posed1, posed2)
    )
    geometry.F = inverse2.T @ geometry.E @ inverse1
    return geometry

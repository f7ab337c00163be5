"""Pairs of a photo that was located in a model: matched along epipolar planes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pycolmap

from sfm_front.epipolar import EpipolarPlanes
from sfm_front.errors import ConfigError
from sfm_front.matching import MatchingOptions, match_meeting
from sfm_front.orientation import turned_alike
from sfm_front.posed import Posed
from sfm_front.types import Candidate, Float64Array, PairGeometry, Uint32Array
from sfm_front.verification import VerificationOptions, View
from sfm_front.workers import Workers

_CALIBRATED = int(pycolmap.TwoViewGeometryConfiguration.CALIBRATED)


@dataclass(frozen=True, kw_only=True)
class GuidedOptions:
    """``max_ratio``: of a match's angle to that of the next best in the band. Stricter than among
    all features: with 0.8 what is near in the band by chance pulled ``strecha_fountain_P11`` from
    a pose AUC of 0.91 at 1° down to 0.66. ``min_agreeing``: share of the re-ranking's inliers
    that must agree with the poses.
    """

    max_ratio: float = 0.7
    min_agreeing: float = 0.8

    def __post_init__(self) -> None:
        if not 0 < self.max_ratio <= 1:
            raise ConfigError(f"max_ratio must be above 0 and at most 1, got {self.max_ratio}")
        if not 0 < self.min_agreeing <= 1:
            raise ConfigError(
                f"min_agreeing must be above 0 and at most 1, got {self.min_agreeing}"
            )


class GuidedPairing:
    """Takes the two-view geometry from the poses in the model, and matches accordingly.

    That only holds where the poses are right: the matches that re-ranking found, without knowing
    of any pose, must agree with them.
    """

    def __init__(
        self,
        options: GuidedOptions,
        matching: MatchingOptions,
        verification: VerificationOptions,
        workers: Workers,
    ) -> None:
        self._options = options
        self._matching = replace(matching, max_ratio=options.max_ratio)
        self._max_error_px = verification.max_error_px
        self._min_inliers = verification.min_inliers
        self._workers = workers

    def match(
        self,
        query: View,
        posed: Posed,
        candidates: Sequence[Candidate],
        views: Mapping[int, View],
        posed_others: Mapping[int, Posed],
    ) -> list[PairGeometry]:
        """Pairs of the query, posed so, with those candidates whose poses are known and agree."""
        rays = posed.rays(query.features.keypoints)

        def match_one(candidate: Candidate) -> PairGeometry | None:
            other, evidence = posed_others.get(candidate.image_id), candidate.matches
            if other is None or evidence is None:
                return None
            view = views[candidate.image_id]
            return self._pair(query, posed, rays, view, other, evidence, candidate.turn_rad)

        pairs = self._workers.map(match_one, candidates)
        return [pair for pair in pairs if pair is not None]

    def _pair(
        self,
        view1: View,
        posed1: Posed,
        rays1: Float64Array,
        view2: View,
        posed2: Posed,
        evidence: Uint32Array,
        turn_rad: float | None,
    ) -> PairGeometry | None:
        """None where the evidence does not bear the poses out, or too little matches."""
        if len(evidence) < self._min_inliers:
            return None
        baseline = posed2.center - posed1.center
        if not baseline.any():
            return None
        rays2 = posed2.rays(view2.features.keypoints)
        planes = EpipolarPlanes(baseline, rays1, rays2)
        band_rad = self._max_error_px / posed2.camera.mean_focal_length()
        agreeing = np.count_nonzero(planes.distances_rad(evidence) <= band_rad)
        if agreeing < max(self._min_inliers, self._options.min_agreeing * len(evidence)):
            return None
        matches = match_meeting(
            view1.features.descriptors,
            view2.features.descriptors,
            planes.meetings(band_rad),
            self._matching,
        )
        if turn_rad is not None:
            keypoints1 = view1.features.keypoints[matches[:, 0]]
            keypoints2 = view2.features.keypoints[matches[:, 1]]
            matches = matches[turned_alike(keypoints1, keypoints2, turn_rad)]
        if len(matches) < self._min_inliers:
            return None
        geometry = two_view_geometry(posed1, posed2)
        geometry.inlier_matches = matches
        cosines = np.einsum("ij,ij->i", rays1[matches[:, 0]], rays2[matches[:, 1]])
        geometry.tri_angle = float(np.median(np.arccos(np.clip(cosines, -1, 1))))
        return PairGeometry(view1.image_id, view2.image_id, matches, geometry)


def two_view_geometry(posed1: Posed, posed2: Posed) -> pycolmap.TwoViewGeometry:
    """As COLMAP has it for calibrated photos: the relative pose with a translation of length 1."""
    geometry = pycolmap.TwoViewGeometry()
    geometry.config = _CALIBRATED
    pose = posed1.relative(posed2)
    pose.translation = pose.translation / np.linalg.norm(pose.translation)
    geometry.cam2_from_cam1 = pose
    geometry.E = pycolmap.essential_matrix_from_pose(pose)
    inverse1, inverse2 = (
        np.linalg.inv(posed.camera.calibration_matrix()) for posed in (posed1, posed2)
    )
    geometry.F = inverse2.T @ geometry.E @ inverse1
    return geometry

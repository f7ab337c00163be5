"""How far what is said of a model's place moves, in units of the uncertainty stated with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass

import numpy as np
import pycolmap

from sfm_front.georeference.anchors import Anchors
from sfm_front.georeference.georeferencer import Georeference

# Cameras that both must have: fewer tell no rotation or scale.
_MIN_COMMON = 3


@dataclass(frozen=True, slots=True)
class Move:
    """In standard deviations as stated first: of the scale, of the way up, of north, and of the
    places of the cameras (the median over them of the axis that moved most)."""

    scale: float
    tilt: float
    heading: float
    cameras: float

    @classmethod
    def largest(cls, moves: Sequence[Move]) -> Move:
        """Of each kind."""
        return cls(*np.max([astuple(move) for move in moves], axis=0).tolist())


@dataclass(frozen=True, slots=True, eq=False)
class FirstSaid:
    """A model's cameras in ENU as they were said to stand first, and how exact that was."""

    anchors: Anchors
    scale_sigma: float
    tilt_sigma_deg: float
    heading_sigma_deg: float

    @classmethod
    def of(cls, georeference: Georeference) -> FirstSaid:
        """Of a model that is aligned."""
        alignment = georeference.alignment
        assert alignment is not None
        return cls(
            Anchors.of(alignment, _poses(georeference)),
            alignment.scale_sigma,
            alignment.tilt_sigma_deg,
            alignment.heading_sigma_deg,
        )

    def move_to(self, later: Georeference) -> Move | None:
        """Since then; None if too few of its photos are left."""
        alignment, poses = later.alignment, _poses(later)
        common = self.anchors.common(poses)
        if alignment is None or len(common) < _MIN_COMMON:
            return None
        now = {i: alignment.enu_from_model.transform_camera_world(poses[i]) for i in common}
        back = self.anchors.enu_from(now, common)
        turned = np.degrees(_rotation_vector(back.rotation))
        before = self.anchors.centres(common)
        moves = np.array([now[i].inverse().translation for i in common]) - before
        times = np.max(np.abs(moves) / self.anchors.sigmas_m(before), axis=1)
        return Move(
            abs(float(np.log(back.scale))) / self.scale_sigma,
            float(np.hypot(turned[0], turned[1])) / self.tilt_sigma_deg,
            abs(float(turned[2])) / self.heading_sigma_deg,
            float(np.median(times)),
        )


def _poses(georeference: Georeference) -> Mapping[int, pycolmap.Rigid3d]:
    return dict(zip(georeference.image_ids, georeference.cam_from_model, strict=True))


def _rotation_vector(rotation: pycolmap.Rotation3d) -> np.ndarray:
    """(3,) radians."""
    x, y, z, w = rotation.quat
    axis = np.array([x, y, z]) * (1 if w >= 0 else -1)
    length = float(np.linalg.norm(axis))
    return axis * (2 * np.arctan2(length, abs(w)) / length) if length else axis

"""Where cameras are in ENU, remembered so that the frame can be found again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pycolmap

from sfm_front.georeference.alignment import Alignment, point_sigmas_m
from sfm_front.georeference.fitting import NUM_PARAMETERS
from sfm_front.types import Float64Array

# Cameras that are remembered, evenly over all.
_MAX_ANCHORS = 200


@dataclass(frozen=True, slots=True, eq=False)
class Anchors:
    """Cameras in ENU by image id, and how exact that is (see ``Alignment``)."""

    cam_from_enu: dict[int, pycolmap.Rigid3d]
    pivot: Float64Array
    covariance: Float64Array
    positions_only: Float64Array

    @classmethod
    def of(cls, alignment: Alignment, cam_from_model: Mapping[int, pycolmap.Rigid3d]) -> Anchors:
        """Some of a model's cameras, as an alignment has them."""
        ids = sorted(cam_from_model)
        ids = ids[:: -(-len(ids) // _MAX_ANCHORS)]
        return cls(
            {
                image_id: alignment.enu_from_model.transform_camera_world(cam_from_model[image_id])
                for image_id in ids
            },
            alignment.pivot,
            alignment.covariance,
            alignment.positions_only,
        )

    def common(self, image_ids: Mapping[int, Any]) -> list[int]:
        """Those that a model has, too."""
        return [image_id for image_id in self.cam_from_enu if image_id in image_ids]

    def centres(self, image_ids: Sequence[int]) -> Float64Array:
        """(A, 3) in ENU."""
        return camera_centres([self.cam_from_enu[image_id] for image_id in image_ids])

    def sigmas_m(self, enu: Float64Array) -> Float64Array:
        """(A, 3) standard deviations of points, when they were remembered."""
        return point_sigmas_m(enu - self.pivot, self.covariance)

    def enu_from(
        self, cam_from_model: Mapping[int, pycolmap.Rigid3d], image_ids: Sequence[int]
    ) -> pycolmap.Sim3d:
        """The similarity that takes a model's cameras back to where they were.

        Their attitudes tell the rotation, so that cameras on a line do, too. At least two.
        """
        ours = [self.cam_from_enu[image_id] for image_id in image_ids]
        theirs = [cam_from_model[image_id] for image_id in image_ids]
        left, _, right = np.linalg.svd(
            sum(
                our.rotation.matrix().T @ their.rotation.matrix()
                for our, their in zip(ours, theirs, strict=True)
            )
        )
        rotation = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
        target, source = camera_centres(ours), camera_centres(theirs)
        spreads = [
            np.sqrt(np.sum((points - points.mean(axis=0)) ** 2)) for points in (target, source)
        ]
        scale = spreads[0] / spreads[1]
        shift = target.mean(axis=0) - scale * rotation @ source.mean(axis=0)
        return pycolmap.Sim3d(float(scale), pycolmap.Rotation3d(rotation), shift)

    def as_json(self) -> dict[str, Any]:
        """Read by ``of_json``."""
        return {
            "cam_from_enu": {
                str(image_id): [*pose.rotation.quat.tolist(), *pose.translation.tolist()]
                for image_id, pose in self.cam_from_enu.items()
            },
            "pivot": self.pivot.tolist(),
            "covariance": self.covariance.tolist(),
            "positions_only": self.positions_only.tolist(),
        }

    @classmethod
    def of_json(cls, row: Mapping[str, Any]) -> Anchors:
        """Back from ``as_json``."""
        shape = NUM_PARAMETERS, NUM_PARAMETERS
        return cls(
            {
                int(image_id): pycolmap.Rigid3d(
                    pycolmap.Rotation3d(np.array(numbers[:4])), np.array(numbers[4:])
                )
                for image_id, numbers in row["cam_from_enu"].items()
            },
            np.array(row["pivot"], np.float64),
            np.array(row["covariance"], np.float64).reshape(shape),
            np.array(row["positions_only"], np.float64).reshape(shape),
        )


def camera_centres(cam_from_world: Sequence[pycolmap.Rigid3d]) -> Float64Array:
    """(N, 3) projection centres in the world."""
    centres = [pose.inverse().translation for pose in cam_from_world]
    return np.array(centres, np.float64).reshape(-1, 3)

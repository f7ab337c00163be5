"""Whether a model that was put together holds: the last word on a join."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.mapping.point_matches import PointMatches


@dataclass(frozen=True, kw_only=True)
class AcceptanceOptions:
    """What refinement must leave of the parts."""

    # Share of the observations of each part.
    min_kept: float = 0.93
    # Share of the matches on which it rests whose keypoints show one point.
    min_common: float = 0.5

    def __post_init__(self) -> None:
        for name in ("min_kept", "min_common"):
            if not 0 <= getattr(self, name) <= 1:
                raise ConfigError(f"{name} must be from 0 to 1, got {getattr(self, name)}")


def is_sound(
    whole: pycolmap.Reconstruction,
    parts: Sequence[pycolmap.Reconstruction],
    common: PointMatches,
    options: AcceptanceOptions,
) -> bool:
    """Whether refinement left the whole all photos, what they observed, and what is common."""
    for part in parts:
        image_ids = part.reg_image_ids()
        if not all(whole.image(i).has_pose for i in image_ids):
            return False
        kept = _num_observations(whole, image_ids) / _num_observations(part, image_ids)
        if kept < options.min_kept:
            return False
    points = [
        [_point_at(whole, *keypoint) for keypoint in of_side]
        for of_side in common.keypoints.tolist()
    ]
    same = [one is not None and one == other for one, other in zip(*points, strict=True)]
    return bool(np.mean(same) >= options.min_common)


def _num_observations(model: pycolmap.Reconstruction, image_ids: Iterable[int]) -> int:
    return sum(int(model.image(image_id).num_points3D) for image_id in image_ids)


def _point_at(model: pycolmap.Reconstruction, image_id: int, index: int) -> int | None:
    point = model.image(image_id).point2D(index)
    return int(point.point3D_id) if point.has_point3D() else None

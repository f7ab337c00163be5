"""What a flight was: how high, how fine, how much ground."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import pycolmap

from sfm_front.georeference.fixes import IntArray
from sfm_front.types import Float64Array

# Points that are looked at: evenly over all.
_MAX_POINTS = 5000
# Height over the points as a share of the distance to them: half of it is 30 degrees down.
_MIN_DOWN = 0.5
# Points beyond these percentiles along either axis may be wrong, and are no ground.
_TRIMMED_PERCENT = 1.0


@dataclass(frozen=True, slots=True)
class FlightFigures:
    """``gsd_cm_per_px``: what a pixel of the file covers on the ground, median over observations.

    ``height_m``: of the cameras over the points they see, median. ``area_m2``: of the convex hull
    of the points, seen from above.
    """

    gsd_cm_per_px: float
    height_m: float
    area_m2: float


def flight_figures(
    model: pycolmap.Reconstruction, enu_from_model: pycolmap.Sim3d
) -> FlightFigures | None:
    """From a model's cameras and points; None without points, or if cameras do not look down."""
    points = [model.points3D[point_id] for point_id in sorted(model.points3D)]
    points = points[:: -(-len(points) // _MAX_POINTS) or 1]
    rows, image_ids = _observations(points)
    if not len(rows):
        return None
    seen_by, columns = np.unique(image_ids, return_inverse=True)
    images = [model.images[int(image_id)] for image_id in seen_by]
    cameras = [model.cameras[image.camera_id] for image in images]
    focals_px = np.array([camera.mean_focal_length() for camera in cameras])
    centres = enu_from_model * np.array([image.projection_center() for image in images])
    ground = enu_from_model * np.array([point.xyz for point in points])
    away = centres[columns] - ground[rows]
    distances, height_m = np.linalg.norm(away, axis=1), float(np.median(away[:, 2]))
    if height_m < _MIN_DOWN * np.median(distances):
        return None
    return FlightFigures(
        gsd_cm_per_px=float(100 * np.median(distances / focals_px[columns])),
        height_m=height_m,
        area_m2=area_of_hull_m2(ground[:, :2]),
    )


def area_of_hull_m2(plane: Float64Array) -> float:
    """Of the convex hull of points (M, 2) in metres, without the outermost along each axis."""
    low, high = np.percentile(plane, (_TRIMMED_PERCENT, 100 - _TRIMMED_PERCENT), axis=0)
    inside = plane[((plane >= low) & (plane <= high)).all(axis=1)]
    if len(inside) < 3:
        return 0.0
    around = inside - inside.mean(axis=0)  # float32 is what OpenCV takes
    return float(cv2.contourArea(cv2.convexHull(around.astype(np.float32))))


def _observations(
    points: list[pycolmap.Point3D],
) -> tuple[IntArray, IntArray]:
    """Rows of the points and ids of the images that see them."""
    rows, image_ids = [], []
    for row, point in enumerate(points):
        for element in point.track.elements:
            rows.append(row)
            image_ids.append(element.image_id)
    return np.array(rows, np.int64), np.array(image_ids, np.int64)

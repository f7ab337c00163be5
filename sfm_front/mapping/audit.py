"""How far the verified pairs of a model agree with its poses.

A pair's own relative pose would be no judge: without a known focal length it is off by tens of
degrees on sound models. Its matches are, whatever the focal length was thought to be.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.geometry.epipolar_error import fits_epipolar
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.geometry.rays import undistorted_rays
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import Float64Array, Uint32Array

BoolArray = NDArray[np.bool_]

# Pixels that a match of a pair may be off the epipolar line: twice what verification allows, for
# the poses have an error too.
_MAX_ERROR_PX = 8.0


def agreeing(
    reconstruction: pycolmap.Reconstruction,
    view_graph: ViewGraph,
    pairs: Iterable[tuple[int, int]],
) -> Iterator[tuple[tuple[int, int], Uint32Array, BoolArray]]:
    """Verified pairs of registered photos, their matches (M, 2), and which of these (M,) lie where
    the poses of the model put them."""
    rays: dict[int, Float64Array] = {}
    for pair in pairs:
        images = [reconstruction.image(image_id) for image_id in pair]
        for image in images:
            if image.image_id not in rays:
                pixels = np.array([point.xy for point in image.points2D], np.float64)
                rays[image.image_id] = undistorted_rays(image.camera, pixels)
        posed = [PosedCamera(image.camera, image.cam_from_world()) for image in images]
        focal_px = 0.5 * sum(image.camera.mean_focal_length() for image in images)
        matches = view_graph.matches(pair)
        yield (
            pair,
            matches,
            fits_epipolar(
                pycolmap.essential_matrix_from_pose(posed[0].relative(posed[1])),
                rays[pair[0]][matches[:, 0]],
                rays[pair[1]][matches[:, 1]],
                _MAX_ERROR_PX / focal_px,
            ),
        )

"""View graphs without geometry: which photos overlap is all that is known."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pycolmap

from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import PairGeometry


def graph_of(num_photos: int, pairs: Iterable[tuple[int, int]]) -> ViewGraph:
    """Photos from 1 on, with pairs of 50 inliers, the later photo first."""
    graph = ViewGraph()
    camera = pycolmap.Camera.create_from_model_name(1, "SIMPLE_RADIAL", 500, 640, 480)
    by_later: dict[int, list[PairGeometry]] = {}
    for later, earlier in pairs:
        geometry = pycolmap.TwoViewGeometry()
        geometry.inlier_matches = np.arange(50, dtype=np.uint32)[:, None].repeat(2, axis=1)
        pair = PairGeometry(later, earlier, np.zeros((0, 2), np.uint32), geometry)
        by_later.setdefault(later, []).append(pair)
    for image_id in range(1, num_photos + 1):
        keypoints = np.zeros((50, 4), np.float32)
        graph.add(image_id, f"{image_id}.jpg", camera, keypoints, by_later.get(image_id, ()))
    return graph


def line(first: int, last: int) -> list[tuple[int, int]]:
    """A flight: each photo with the two before it."""
    return [(i, j) for i in range(first, last + 1) for j in (i - 1, i - 2) if j >= first]

"""A photo that sees a place a second time, where the model holds it twice: the loop is closed."""

from __future__ import annotations

import copy
import time
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.events import Emit, LoopClosed
from sfm_front.geometry.similarity import Similarities
from sfm_front.mapping.acceptance import AcceptanceOptions, is_sound
from sfm_front.mapping.bridging import Bridging, BridgingOptions, find_bridging
from sfm_front.mapping.drift import Correction, corrections, move
from sfm_front.mapping.model import Model
from sfm_front.mapping.point_matches import Side
from sfm_front.mapping.view_graph import ViewGraph

# Matches of a pair that are looked at to see whether it is open.
_SAMPLE = 60


@dataclass(frozen=True, kw_only=True)
class LoopOptions:
    """When a loop is closed."""

    # A pair is open if at least so many of its matches lead to points of the model on both sides,
    # and to the same point in less than this share.
    min_matches: int = 10
    max_same: float = 0.3
    # Nothing has to be closed that lies nearer together than this, in pixels of the file: COLMAP
    # merges such points by itself.
    min_drift_px: float = 4.0
    # Share of the drift that may fall between two photos: what comes about on a shorter way is no
    # drift, but a wrong match or a bent model.
    max_step: float = 0.1
    bridging: BridgingOptions = field(default_factory=BridgingOptions)
    acceptance: AcceptanceOptions = field(default_factory=AcceptanceOptions)

    def __post_init__(self) -> None:
        if self.min_matches < 1:
            raise ConfigError(f"min_matches must be at least 1, got {self.min_matches}")
        if self.min_drift_px < 0:
            raise ConfigError(f"min_drift_px must not be negative, got {self.min_drift_px}")
        for name in ("max_same", "max_step"):
            if not 0 < getattr(self, name) <= 1:
                raise ConfigError(
                    f"{name} must be above 0 and at most 1, got {getattr(self, name)}"
                )


class LoopCloser:
    """Closes loops in models over one view graph."""

    def __init__(
        self, view_graph: ViewGraph, options: LoopOptions, emit: Emit, *, seed: int
    ) -> None:
        """``emit`` hears of each loop."""
        self._view_graph = view_graph
        self._options = options
        self._emit = emit
        self._seed = seed

    def close(self, model: Model, image_ids: Iterable[int]) -> Model:
        """The model with the loops closed that these photos complete; or the one given."""
        for image_id in image_ids:
            closed = self._closed_at(model, image_id)
            if closed is not None:
                model = closed
        return model

    def _closed_at(self, model: Model, image_id: int) -> Model | None:
        started = time.perf_counter()
        reconstruction = model.reconstruction
        if not reconstruction.image(image_id).has_pose:
            return None
        there = self._open_neighbors(reconstruction, image_id)
        if not there:
            return None
        here = Side(reconstruction, self._side_of(reconstruction, image_id, there))
        old = Side(reconstruction, there)
        bridging = find_bridging(self._view_graph, old, here, self._options.bridging, self._seed)
        if bridging is None:
            return None
        drift_px = _drift_px(bridging)
        if drift_px < self._options.min_drift_px:
            return None
        links = self._links(reconstruction)
        correction = Correction(self._simplest(bridging), here.image_ids, old.image_ids)
        found = corrections(reconstruction, links, correction)
        if max(abs(found[i][0] - found[j][0]) for i, j in links) > self._options.max_step:
            return None
        corrected = copy.deepcopy(reconstruction)
        move(corrected, {i: similarity for i, (_, similarity) in found.items()})
        _merge(corrected, bridging.same_points)
        closed = model.succeeded_by(corrected)
        closed.refine_briefly()
        parts = (reconstruction,)
        if not is_sound(closed.reconstruction, parts, bridging.matches, self._options.acceptance):
            return None
        closed.emit = self._emit
        self._emit(
            LoopClosed(
                model.model_id,
                model.num_registered,
                bridging.bridges,
                len(bridging.same_points),
                drift_px,
                time.perf_counter() - started,
            )
        )
        return closed

    def _simplest(self, bridging: Bridging) -> pycolmap.Sim3d:
        """A shift alone where it explains most of the matches: points that lie near to each other
        hardly tell a turn and a scale, which would go all the way round."""
        old, here = bridging.matches.xyz
        shift = np.median(old - here, axis=0)
        shifted = Similarities(np.ones(1), np.eye(3)[None], shift[None])
        fits = bridging.matches.errors_px(shifted) < self._options.bridging.similarity.max_error_px
        if fits.mean() < self._options.bridging.min_share:
            return bridging.first_from_second
        return shifted.only()

    def _open_neighbors(self, model: pycolmap.Reconstruction, image_id: int) -> list[int]:
        """Photos with pairs with this one whose keypoints lead to other points than its own."""
        found = []
        for other in self._view_graph.strongest_neighbors(image_id):
            shared = self._shared(model, image_id, other)
            if shared is not None and shared < self._options.max_same:
                found.append(other)
        return found

    def _side_of(self, model: pycolmap.Reconstruction, image_id: int, there: list[int]) -> set[int]:
        """The photo, and those that share its points and are not on the other side."""
        here = {image_id}
        for other in self._view_graph.neighbors(image_id):
            shared = self._shared(model, image_id, other)
            if other not in there and shared is not None and shared >= 1 - self._options.max_same:
                here.add(other)
        return here

    def _shared(self, model: pycolmap.Reconstruction, image_id: int, other: int) -> float | None:
        """Share of a pair's matches with points on both sides that have the same; None for few."""
        if not model.image(other).has_pose:
            return None
        image1, image2 = model.image(image_id), model.image(other)
        matches = self._view_graph.matches(image_id, other)
        same = [
            one.point3D_id == two.point3D_id
            for index1, index2 in matches[:: max(1, len(matches) // _SAMPLE)].tolist()
            for one, two in [(image1.point2D(index1), image2.point2D(index2))]
            if one.has_point3D() and two.has_point3D()
        ]
        return sum(same) / len(same) if len(same) >= self._options.min_matches else None

    def _links(self, model: pycolmap.Reconstruction) -> dict[tuple[int, int], float]:
        """Pairs that are not open, by the inliers they have."""
        return {
            pair: float(self._view_graph.neighbors(pair[0])[pair[1]])
            for pair in self._view_graph.pairs(model.reg_image_ids())
            for shared in [self._shared(model, *pair)]
            if shared is not None and shared >= self._options.max_same
        }


def _drift_px(bridging: Bridging) -> float:
    """Median distance of the matches as the model has them."""
    as_it_is = Similarities(np.ones(1), np.eye(3)[None], np.zeros((1, 3)))
    return float(np.median(bridging.matches.errors_px(as_it_is)))


def _merge(model: pycolmap.Reconstruction, same_points: Iterable[tuple[int, int]]) -> None:
    """Make points one; each may be in several of these."""
    now: dict[int, int] = {}

    def current(point_id: int) -> int:
        while point_id in now:
            point_id = now[point_id]
        return point_id

    for pair in same_points:
        one, other = map(current, pair)
        if one != other:
            now[one] = now[other] = model.merge_points3D(one, other)

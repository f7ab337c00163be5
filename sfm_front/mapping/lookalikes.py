"""Whether a model is folded: things that look alike were taken for one, and stand in one place.

Where they do, their surroundings contradict each other. Photos of the one and photos of the other
see the look-alike itself together, but each sees things beside it that the other should see, and
does not.

The test is that of Heinly, Dunn and Frahm, "Correcting for Duplicate Scene Structure in Sparse 3D
Reconstruction", ECCV 2014: the photos are parted at each edge of a spanning tree, and the parts are
compared. A point that a photo happens to miss does not count: nobody in the whole other part may
have seen it. What is counted are missing correspondences as in Zach, Irschara and Bischof, "What
Can Missing Correspondences Tell Us About 3D Structure and Motion?", CVPR 2008, by area; both parts
must miss some, for one alone may be out of focus, or behind something.

Nor does a point that a verified match says the other photo sees, about where it should: where two
ends of a long way round meet, each has points of its own of the same things, as far apart as the
model has drifted (TUNING: fold-drift).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.mapping.covisibility import BoolArray, Covisibility, IndexArray, parts
from sfm_front.mapping.photo_grid import CELLS, cells_of, occupied, widened
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import Float64Array

_NOWHERE: Float64Array = np.zeros((0, 2))


@dataclass(frozen=True, kw_only=True)
class FoldOptions:
    """What tells a folded model."""

    # Cells, a 24th of the long side each, in which a photo of either part misses what the other
    # part sees there, on average, and their share of those in which it sees the same
    # (TUNING: fold). Few cells tell little; a small share may be something that was moved between
    # two visits.
    min_cells: float = 7.0
    min_share: float = 0.08
    # Observations of the points that count. Passers-by and wrong matches have fewer.
    min_observers: int = 3
    # Two photos are compared if they share this many points, and see them from directions that
    # differ by no more than this.
    min_shared: int = 8
    max_angle_deg: float = 20.0
    # Pairs of photos compared per edge, those that share most first.
    max_pairs: int = 30

    def __post_init__(self) -> None:
        if self.min_cells <= 0:
            raise ConfigError(f"min_cells must be above 0, got {self.min_cells}")
        if not 0 < self.min_share < 1:
            raise ConfigError(f"min_share must be above 0 and below 1, got {self.min_share}")
        for name in ("min_observers", "min_shared", "max_pairs"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")


def find_fold(
    reconstruction: pycolmap.Reconstruction,
    view_graph: ViewGraph,
    options: FoldOptions | None = None,
) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Image ids of the two parts of a model that contradict each other most, the larger first.

    None if none do so enough to tell.
    """
    comparison = _Comparison(reconstruction, view_graph, options or FoldOptions())
    worst, largest = None, 0.0
    for beyond in comparison.sharing.halves():
        conflict = comparison.conflict(beyond)
        if conflict > largest:
            worst, largest = beyond, conflict
    return None if worst is None else parts(comparison.covisibility.image_ids, worst)


class _Comparison:
    """What the photos of a model see of each other's points."""

    def __init__(
        self,
        reconstruction: pycolmap.Reconstruction,
        view_graph: ViewGraph,
        options: FoldOptions,
    ) -> None:
        self._reconstruction = reconstruction
        self._view_graph = view_graph
        self._options = options
        self.covisibility = Covisibility.of(reconstruction, min_observers=options.min_observers)
        self.sharing = self.covisibility.sharing()
        self._comparable = self.sharing.pairs(options.min_shared)
        # Of those; nan until it is asked for.
        self._angles_deg = np.full(len(self._comparable), np.nan)
        images = [reconstruction.image(int(i)) for i in self.covisibility.image_ids]
        self._posed = [
            PosedCamera(reconstruction.camera(image.camera_id), image.cam_from_world())
            for image in images
        ]
        self._centers = np.array([posed.center for posed in self._posed])
        self._bounds: dict[tuple[int, int], IndexArray] = {}
        # For ``_split``: of many pairs, sorting would take most of the time.
        self._is_marked = np.zeros(len(self.covisibility.points), np.bool_)

    def conflict(self, beyond: BoolArray) -> float:
        """Cells in which the photos ``beyond`` (N,) or the others miss what both should see, of the
        part that misses less; 0 if it is not enough to tell."""
        pairs = self._pairs(beyond)
        # Comparing each pair by itself finds no less to miss and no more that is shared, and can be
        # remembered: it does for most parts of a model that is not folded.
        if self._missing([self._bound(pair) for pair in pairs]) == 0:
            return 0.0
        seen = [self.covisibility.seen_by(part) for part in (beyond, ~beyond)]
        return self._missing([self._compare(pair, seen[1], seen[0]) for pair in pairs])

    def _missing(self, cells: list[IndexArray]) -> float:
        """``cells``: for each pair what ``_cells`` counts."""
        missing, same = np.sum(cells, axis=0) if cells else np.zeros((2, 2))
        if missing.min() < max(1, self._options.min_cells * len(cells)):
            return 0.0
        share = (missing / (missing + same)).min()
        return float(missing.min()) if share >= self._options.min_share else 0.0

    def _pairs(self, beyond: BoolArray) -> list[tuple[int, int]]:
        """The pairs to compare, the first photo of each ``beyond``."""
        first, second = self._comparable.T
        angles, most = self._angles_deg, self._options.max_angle_deg
        crossing = np.flatnonzero((beyond[first] != beyond[second]) & ~(angles > most))
        chosen: list[tuple[int, int]] = []
        for row in crossing.tolist():
            one, other = self._comparable[row].tolist()
            if np.isnan(angles[row]):
                angles[row] = self._angle_deg((one, other))
            if angles[row] <= most:
                chosen.append((one, other) if beyond[one] else (other, one))
                if len(chosen) == self._options.max_pairs:
                    break
        return chosen

    def _angle_deg(self, pair: tuple[int, int]) -> float:
        """Median angle between the directions in which two photos see the points they share."""
        _, _, shared = self._split(pair)
        points = self.covisibility.points[shared]
        rays1, rays2 = (points - self._centers[photo] for photo in pair)
        cosine = np.einsum("nd,nd->n", rays1, rays2)
        cosine /= np.linalg.norm(rays1, axis=1) * np.linalg.norm(rays2, axis=1)
        return float(np.degrees(np.arccos(np.clip(np.median(cosine), -1, 1))))

    def _split(self, pair: tuple[int, int]) -> tuple[IndexArray, IndexArray, IndexArray]:
        """Points that the first photo alone observes, the second alone, and both."""
        first, second = (self.covisibility.observed[photo] for photo in pair)
        self._is_marked[second] = True
        both = self._is_marked[first]
        self._is_marked[second] = False
        self._is_marked[first] = True
        of_second = second[~self._is_marked[second]]
        self._is_marked[first] = False
        return first[~both], of_second, first[both]

    def _bound(self, pair: tuple[int, int]) -> IndexArray:
        """At least as many cells in which things are missing, and no more that are the same, than
        in any two parts."""
        if pair not in self._bounds:
            of_first, of_second, shared = self._split(pair)
            self._bounds[pair] = self._cells(pair, (of_first, of_second), shared)
            self._bounds[pair[::-1]] = self._bounds[pair][:, ::-1]
        return self._bounds[pair]

    def _compare(
        self, pair: tuple[int, int], seen_by_others: BoolArray, seen_by_own: BoolArray
    ) -> IndexArray:
        """``seen_by_others`` (P,): points that the part of the second photo observes;
        ``seen_by_own``: those that the part of the first does."""
        first, second = (self.covisibility.observed[photo] for photo in pair)
        unique = first[~seen_by_others[first]], second[~seen_by_own[second]]
        shared = np.union1d(first[seen_by_others[first]], second[seen_by_own[second]])
        return self._cells(pair, unique, shared, (self._found(pair), self._found(pair[::-1])))

    def _found(self, pair: tuple[int, int]) -> Float64Array:
        """(K, 2) pixels of the first photo that matches link to points of the second, and that lie
        within a cell of these."""
        first, second = (
            self._reconstruction.image(int(self.covisibility.image_ids[photo])) for photo in pair
        )
        pixels, points = [], []
        for ours, theirs in self._view_graph.matches(first.image_id, second.image_id).tolist():
            seen = second.point2D(theirs)
            if seen.has_point3D():
                pixels.append(first.point2D(ours).xy)
                points.append(self._reconstruction.point3D(seen.point3D_id).xyz)
        found = np.array(pixels, np.float64).reshape(-1, 2)
        posed = self._posed[pair[0]]
        off = posed.project(np.array(points, np.float64).reshape(-1, 3)) - found
        cell = max(posed.camera.width, posed.camera.height) / CELLS
        # False for nan: points behind the camera.
        near: Float64Array = found[np.abs(off).max(axis=1, initial=0) <= cell]
        return near

    def _cells(
        self,
        pair: tuple[int, int],
        unique: tuple[IndexArray, IndexArray],
        shared: IndexArray,
        found: tuple[Float64Array, Float64Array] = (_NOWHERE, _NOWHERE),
    ) -> IndexArray:
        """(2, 2) cells in which the first photo and the second miss unique points of the other,
        with no shared ones near; and cells with shared points. ``found``: pixels of either photo
        that count as shared points too."""
        counts = []
        for photo, theirs, also in zip(pair, unique[::-1], found, strict=True):
            posed = self._posed[photo]
            pixels = posed.project(self.covisibility.points[np.concatenate([theirs, shared])])
            cells = cells_of(np.concatenate([pixels, also]), posed.camera)
            missing, same = occupied(cells[: len(theirs)]), occupied(cells[len(theirs) :])
            missing &= ~widened(same)
            counts.append((np.count_nonzero(missing), np.count_nonzero(same)))
        missing_and_same: IndexArray = np.array(counts, np.int64).T
        return missing_and_same

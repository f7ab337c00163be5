"""Whether a model is folded: things that look alike were taken for one, and stand in one place.

Where they do, their surroundings contradict each other. Photos of the one and photos of the other
see the look-alike itself together, and beside it, in the same place, different things.

The test is that of Heinly, Dunn and Frahm, "Correcting for Duplicate Scene Structure in Sparse 3D
Reconstruction", ECCV 2014, with cells of a grid in place of segments: the photos are parted at each
edge of a spanning tree, and the parts are compared. A point that a photo happens to miss does not
count: nobody in the other part may have seen it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.geometry.posed_camera import PosedCamera
from sfm_front.mapping.covisibility import BoolArray, Covisibility, IndexArray, halves, parts
from sfm_front.mapping.photo_grid import cells_of, occupied, widened


@dataclass(frozen=True, kw_only=True)
class FoldOptions:
    """What tells a folded model."""

    # Cells, a 24th of the long side each, in which two photos of a folded model see different
    # things, on average, and their share of all cells that both see (TUNING: fold-conflict). Few
    # cells tell little; a small share may be something that was moved between two visits.
    min_cells: float = 5.0
    min_share: float = 0.05
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
    reconstruction: pycolmap.Reconstruction, options: FoldOptions | None = None
) -> tuple[tuple[int, ...], tuple[int, ...]] | None:
    """Image ids of the two parts of a model that contradict each other most, the larger first.

    None if none do so enough to tell.
    """
    comparison = _Comparison(reconstruction, options or FoldOptions())
    worst, largest = None, 0.0
    for beyond in halves(comparison.num_shared):
        conflict = comparison.conflict(beyond)
        if conflict > largest:
            worst, largest = beyond, conflict
    return None if worst is None else parts(comparison.covisibility.image_ids, worst)


class _Comparison:
    """What the photos of a model see of each other's points."""

    def __init__(self, reconstruction: pycolmap.Reconstruction, options: FoldOptions) -> None:
        self._options = options
        self.covisibility = Covisibility.of(reconstruction, min_observers=options.min_observers)
        self.num_shared = self.covisibility.num_shared()
        images = [reconstruction.image(int(i)) for i in self.covisibility.image_ids]
        self._posed = [
            PosedCamera(reconstruction.camera(image.camera_id), image.cam_from_world())
            for image in images
        ]
        self._centers = np.array([posed.center for posed in self._posed])
        self._angles_deg: dict[tuple[int, int], float] = {}
        self._bounds: dict[tuple[int, int], tuple[int, int]] = {}

    def conflict(self, beyond: BoolArray) -> float:
        """Share of what the photos ``beyond`` (N,) and the others see in which they differ; 0 if
        it is not enough to tell."""
        pairs = self._pairs(beyond)
        # Comparing each pair by itself finds no less to differ and no more to agree, and can be
        # remembered: it does for most parts of a model that is not folded.
        if self._share([self._bound(pair) for pair in pairs]) == 0:
            return 0.0
        seen = [self.covisibility.seen_by(part) for part in (beyond, ~beyond)]
        return self._share([self._compare(pair, seen[1], seen[0]) for pair in pairs])

    def _share(self, counts: list[tuple[int, int]]) -> float:
        """Of the cells that differ among all; 0 if they are too few or too small a share."""
        different, same = (
            (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0)
        )
        if different < self._options.min_cells * len(counts):
            return 0.0
        share = different / max(1, different + same)
        return share if share >= self._options.min_share else 0.0

    def _pairs(self, beyond: BoolArray) -> list[tuple[int, int]]:
        """The pairs to compare, the first photo of each ``beyond``."""
        inside, outside = np.flatnonzero(beyond), np.flatnonzero(~beyond)
        shared = self.num_shared[np.ix_(inside, outside)]
        rows, columns = np.nonzero(shared >= self._options.min_shared)
        order = np.argsort(-shared[rows, columns], kind="stable")
        chosen: list[tuple[int, int]] = []
        for row, column in zip(rows[order], columns[order], strict=True):
            pair = int(inside[row]), int(outside[column])
            if self._angle_deg(pair) <= self._options.max_angle_deg:
                chosen.append(pair)
                if len(chosen) == self._options.max_pairs:
                    break
        return chosen

    def _angle_deg(self, pair: tuple[int, int]) -> float:
        """Median angle between the directions in which two photos see the points they share."""
        key = min(pair), max(pair)
        if key not in self._angles_deg:
            first, second = (self.covisibility.observed[photo] for photo in key)
            points = self.covisibility.points[np.intersect1d(first, second, assume_unique=True)]
            rays1, rays2 = (points - self._centers[photo] for photo in key)
            cosine = np.einsum("nd,nd->n", rays1, rays2)
            cosine /= np.linalg.norm(rays1, axis=1) * np.linalg.norm(rays2, axis=1)
            angle = float(np.degrees(np.arccos(np.clip(np.median(cosine), -1, 1))))
            self._angles_deg[key] = angle
        return self._angles_deg[key]

    def _bound(self, pair: tuple[int, int]) -> tuple[int, int]:
        """At least as many cells that differ, and no more that agree, than in any two parts."""
        key = min(pair), max(pair)
        if key not in self._bounds:
            first, second = (self.covisibility.observed[photo] for photo in key)
            shared = np.intersect1d(first, second, assume_unique=True)
            unique = np.setdiff1d(first, shared, True), np.setdiff1d(second, shared, True)
            self._bounds[key] = self._fewest(key, unique, shared)
        return self._bounds[key]

    def _compare(
        self, pair: tuple[int, int], seen_by_others: BoolArray, seen_by_own: BoolArray
    ) -> tuple[int, int]:
        """Cells in which two photos show different things, and those in which they show the same.

        ``seen_by_others`` (P,): points that the part of the second photo observes, ``seen_by_own``
        those that the part of the first does.
        """
        first, second = (self.covisibility.observed[photo] for photo in pair)
        unique = first[~seen_by_others[first]], second[~seen_by_own[second]]
        shared = np.union1d(first[seen_by_others[first]], second[seen_by_own[second]])
        return self._fewest(pair, unique, shared)

    def _fewest(
        self, pair: tuple[int, int], unique: tuple[IndexArray, IndexArray], shared: IndexArray
    ) -> tuple[int, int]:
        """Of the two photos the cells of the one with fewer differences."""
        first = self._differences(pair[0], unique, shared)
        return min(first, self._differences(pair[1], unique, shared)) if first[0] else first

    def _differences(
        self, photo: int, unique: tuple[IndexArray, IndexArray], shared: IndexArray
    ) -> tuple[int, int]:
        """Of one photo: cells with unique points of both sides and no shared ones near, and cells
        with shared points. Points count where they would lie, visible or hidden."""
        posed = self._posed[photo]
        pixels = posed.project(self.covisibility.points[np.concatenate([*unique, shared])])
        cells = cells_of(pixels, posed.camera)
        start, end = len(unique[0]), len(unique[0]) + len(unique[1])
        ours, theirs, same = (
            occupied(part) for part in (cells[:start], cells[start:end], cells[end:])
        )
        either = (ours & widened(theirs)) | (widened(ours) & theirs)
        different = either & ~widened(same)
        return int(np.count_nonzero(different)), int(np.count_nonzero(same))

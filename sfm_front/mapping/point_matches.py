"""Points of two models that are the same, by the verified pairs of the photos between them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.geometry.rays import undistorted_rays
from sfm_front.geometry.similarity import Similarities
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import Float64Array

# Photos of each model through which a photo that is in neither links them, strongest pairs first.
_NEIGHBORS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """N keypoints in posed photos: ``rotations`` (N, 3, 3) and ``translations`` (N, 3) of
    cam_from_world, ``rays`` (N, 2) the keypoints without distortion at z = 1, ``focal_px`` (N,)."""

    rotations: Float64Array
    translations: Float64Array
    rays: Float64Array
    focal_px: Float64Array

    def some(self, rows: NDArray[Any]) -> Sightings:
        """Those in these rows."""
        return Sightings(
            self.rotations[rows], self.translations[rows], self.rays[rows], self.focal_px[rows]
        )

    def residuals_px(self, points: Float64Array) -> Float64Array:
        """(H, N, 3) world points → (H, N, 2) undistorted pixels between them and the keypoints;
        infinite behind the camera."""
        in_camera = np.einsum("nij,hnj->hni", self.rotations, points) + self.translations
        ahead = in_camera[..., 2] > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            off = in_camera[..., :2] / in_camera[..., 2:] - self.rays
        return np.where(ahead[..., None], off * self.focal_px[:, None], np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class PointMatches:
    """K matches of keypoints that lead to a point of either side.

    ``bridges`` (K,): image id of the photo that a match hangs on. ``ids`` (K, 2) int64: the points
    of both sides, ``xyz`` (2, K, 3) where they are, each in its own world frame. ``keypoints``
    (2, K, 2) int64: image id and index of those by which each side observes its point, and ``seen``
    what they show.
    """

    bridges: NDArray[np.int64]
    ids: NDArray[np.int64]
    keypoints: NDArray[np.int64]
    xyz: Float64Array
    seen: tuple[Sightings, Sightings]

    def __len__(self) -> int:
        return len(self.ids)

    def some(self, rows: NDArray[Any]) -> PointMatches:
        """Those in these rows."""
        seen = self.seen[0].some(rows), self.seen[1].some(rows)
        return PointMatches(
            self.bridges[rows], self.ids[rows], self.keypoints[:, rows], self.xyz[:, rows], seen
        )

    def errors_px(self, first_from_second: Similarities) -> Float64Array:
        """(H, K): the larger of the distances between where a point of either side falls in the
        photo of the other and its keypoint there. H similarities."""
        residuals = self.residuals_px(first_from_second)
        lengths = np.linalg.norm(residuals.reshape(*residuals.shape[:2], 2, 2), axis=3)
        errors: Float64Array = np.where(np.isnan(lengths), np.inf, lengths).max(axis=2)
        return errors

    def residuals_px(self, first_from_second: Similarities) -> Float64Array:
        """(H, K, 4): these distances along x and y, in the first side's photos and the second's."""
        in_first = self.seen[0].residuals_px(first_from_second(self.xyz[1]))
        in_second = self.seen[1].residuals_px(first_from_second.inverse()(self.xyz[0]))
        return np.concatenate([in_first, in_second], axis=2)


class Side:
    """Photos of a model that are registered in it, and the points that they observe."""

    def __init__(self, model: pycolmap.Reconstruction, image_ids: Iterable[int]) -> None:
        self.model = model
        self.image_ids = frozenset(image_ids)
        self._points: dict[int, NDArray[np.int64]] = {}

    @classmethod
    def all_of(cls, model: pycolmap.Reconstruction) -> Side:
        """All its photos."""
        return cls(model, model.reg_image_ids())

    def points(self, image_id: int) -> NDArray[np.int64]:
        """(N,) point id of each keypoint of a photo, -1 where there is none."""
        if image_id not in self._points:
            image = self.model.image(image_id)
            points = np.full(image.num_points2D(), -1, np.int64)
            for index in image.get_observation_point2D_idxs():
                points[index] = image.point2D(index).point3D_id
            self._points[image_id] = points
        return self._points[image_id]

    def sightings(self, keypoints: NDArray[np.int64]) -> Sightings:
        """Of keypoints (N, 2): image id and index."""
        image_ids, rows = np.unique(keypoints[:, 0], return_inverse=True)
        images = [self.model.image(i) for i in image_ids]
        cameras = [self.model.camera(image.camera_id) for image in images]
        poses = [image.cam_from_world() for image in images]
        rays = np.empty((len(keypoints), 2))
        for number, (image, camera) in enumerate(zip(images, cameras, strict=True)):
            mine = np.flatnonzero(rows == number)
            pixels = np.array([image.point2D(k).xy for k in keypoints[mine, 1]])
            rays[mine] = undistorted_rays(camera, pixels)[:, :2]
        return Sightings(
            np.array([pose.rotation.matrix() for pose in poses]).reshape(-1, 3, 3)[rows],
            np.array([pose.translation for pose in poses]).reshape(-1, 3)[rows],
            rays,
            np.array([camera.mean_focal_length() for camera in cameras])[rows],
        )


def match_points(
    view_graph: ViewGraph, first: Side, second: Side, *, sample: int, seed: int
) -> PointMatches:
    """Points of the first side and of the second that keypoints of verified pairs say are one.

    Three kinds of photos bring them: those of one side with pairs into the other, those of both,
    and those of neither with pairs into both. At most ``sample`` matches of each bridge are kept.
    """
    found = [_matches_of(link, first, second) for link in _links(view_graph, first, second)]
    rows = np.concatenate([*found, np.empty((0, 7), np.int64)])
    # Several pairs of a bridge may lead to the same points.
    _, once = np.unique(rows[:, :3], axis=0, return_index=True)
    rows = rows[np.sort(once)]
    rng = np.random.default_rng(seed)
    kept = [
        np.sort(rng.permutation(np.flatnonzero(rows[:, 0] == bridge))[:sample])
        for bridge in np.unique(rows[:, 0])
    ]
    rows = rows[np.concatenate([*kept, np.empty(0, np.int64)])]
    ids = rows[:, 1:3]
    xyz = [
        np.array([side.model.point3D(i).xyz for i in of_side]).reshape(-1, 3)
        for side, of_side in zip((first, second), ids.T, strict=True)
    ]
    keypoints = np.array([rows[:, 3:5], rows[:, 5:7]])
    seen = first.sightings(keypoints[0]), second.sightings(keypoints[1])
    return PointMatches(rows[:, 0], ids, keypoints, np.array(xyz), seen)


@dataclass(frozen=True, slots=True, eq=False)
class _Link:
    """Matches (M, 2) of keypoints of a photo of the first side and one of the second."""

    bridge: int
    image_ids: tuple[int, int]
    matches: NDArray[np.integer[Any]]


def _matches_of(link: _Link, first: Side, second: Side) -> NDArray[np.int64]:
    """(M, 7): bridge, the points of both sides, image id and keypoint of either side."""
    in_first, in_second = link.matches.T.astype(np.int64)
    image1, image2 = link.image_ids
    points1, points2 = first.points(image1)[in_first], second.points(image2)[in_second]
    columns = np.broadcast_arrays(
        link.bridge, points1, points2, image1, in_first, image2, in_second
    )
    rows: NDArray[np.int64] = np.column_stack(columns)[(points1 >= 0) & (points2 >= 0)]
    return rows


def _links(view_graph: ViewGraph, first: Side, second: Side) -> Iterator[_Link]:
    only_first, only_second = first.image_ids - second.image_ids, second.image_ids - first.image_ids
    pairs = [
        (i, j)
        for j in sorted(only_second)
        for i in sorted(view_graph.neighbors(j))
        if i in only_first
    ]
    across = Counter(chain.from_iterable(pairs))
    for pair in pairs:
        # All pairs of a photo that sees several of the other side are one bridge.
        bridge = max(pair, key=lambda image_id: (across[image_id], image_id))
        yield _Link(bridge, pair, view_graph.matches(*pair))
    for image_id in sorted(first.image_ids & second.image_ids):
        keypoints = np.arange(len(first.points(image_id)))
        yield _Link(image_id, (image_id, image_id), np.column_stack([keypoints, keypoints]))
    for image_id in view_graph.image_ids:
        if image_id not in first.image_ids | second.image_ids:
            yield from _links_through(view_graph, image_id, first, second)


def _links_through(
    view_graph: ViewGraph, image_id: int, first: Side, second: Side
) -> Iterator[_Link]:
    """By a photo of neither side: its keypoints that are matched in both."""
    strongest = view_graph.strongest_neighbors(image_id)
    for i in [i for i in strongest if i in first.image_ids][:_NEIGHBORS]:
        here = view_graph.matches(image_id, i)
        for j in [j for j in strongest if j in second.image_ids][:_NEIGHBORS]:
            there = view_graph.matches(image_id, j)
            _, at, to = np.intersect1d(here[:, 0], there[:, 0], return_indices=True)
            yield _Link(image_id, (i, j), np.column_stack([here[at, 1], there[to, 1]]))

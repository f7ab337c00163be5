"""A walk past two things that look alike, in different surroundings, with known truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pycolmap

from helpers.model_building import FOCAL, HEIGHT, WIDTH, looking
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import PairGeometry

NUM_PHOTOS = 19
_STEP, _APART, _DISTANCE = 0.5, 6.0, 4.0
_NUM_ALIKE, _NUM_BESIDE, _NUM_BETWEEN = 200, 60, 60
_SHIFTS = (0.0, _APART, -_APART)
MIN_MATCHES = 15
# Of the points that two ends of a way see which have drifted apart, one in so many is one point.
_ONE_IN = 6


class LookAlikeWalk:
    """Photos 0 to 18 along a line. The first and the last see one of two things each, that have
    the same points; those between see neither whole. All see what stands beside and between.

    ``points`` (P, 3); ``looks`` (P,): points with the same number cannot be told apart.
    """

    def __init__(self, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        alike = rng.uniform((-0.8, -0.5, -0.8), (0.8, 0.5, 0.8), (_NUM_ALIKE, 3))
        self.offset = np.array([_APART, 0.0, 0.0])
        beside = [
            place + rng.uniform((-1.8, -0.5, -1.4), (1.8, 0.8, 1.4), (_NUM_BESIDE, 3))
            for place in (np.zeros(3), self.offset)
        ]
        between = rng.uniform((1.5, -0.5, -1.2), (_APART - 1.5, 0.5, 1.2), (_NUM_BETWEEN, 3))
        self.points = np.concatenate([alike, alike + self.offset, *beside, between])
        numbers = np.arange(_NUM_ALIKE)
        others = _NUM_ALIKE + np.arange(2 * _NUM_BESIDE + _NUM_BETWEEN)
        self.looks = np.concatenate([numbers, numbers, others])
        self.camera = pycolmap.Camera(
            camera_id=1,
            model="SIMPLE_PINHOLE",
            width=WIDTH,
            height=HEIGHT,
            params=[FOCAL, WIDTH / 2, HEIGHT / 2],
        )
        self.camera.has_prior_focal_length = True
        xs = _STEP * np.arange(NUM_PHOTOS) - (_STEP * (NUM_PHOTOS - 1) - _APART) / 2
        self.poses = [
            looking([x, -_DISTANCE, 0.1 * (-1) ** i], [0.05 * (-1) ** i, 1, 0], [0, 0, 1])
            for i, x in enumerate(xs)
        ]
        seen = [self._seen(pose) for pose in self.poses]
        self.ids = [ids for ids, _ in seen]
        self.pixels = [pixels + rng.normal(0, 0.3, pixels.shape) for _, pixels in seen]

    def _seen(self, pose: pycolmap.Rigid3d) -> tuple[np.ndarray, np.ndarray]:
        in_camera = self.points @ pose.rotation.matrix().T + pose.translation
        pixels = np.asarray(self.camera.img_from_cam(in_camera))
        ids = np.flatnonzero(((pixels > 0) & (pixels < (WIDTH, HEIGHT))).all(axis=1))
        return ids, pixels[ids]

    def pair(
        self,
        first: int,
        second: int,
        image_ids: tuple[int, int],
        shifts: Sequence[float] = _SHIFTS,
    ) -> PairGeometry | None:
        """What verification makes of two photos: the largest set of matches that fit one pose,
        by which things have moved sideways by one of ``shifts``."""
        ids1, ids2 = self.ids[first], self.ids[second]
        rows, columns = np.nonzero(self.looks[ids1][:, None] == self.looks[ids2][None, :])
        shift = self.points[ids2[columns]] - self.points[ids1[rows]]
        best = None
        for sideways in shifts:
            fits = np.abs(shift[:, 0] - sideways) < 1e-9
            if best is None or fits.sum() > best[0].sum():
                best = fits, sideways
        assert best is not None
        fits, sideways = best
        if fits.sum() < MIN_MATCHES:
            return None
        matches = np.column_stack([rows[fits], columns[fits]]).astype(np.uint32)
        # The second photo as if it had been taken where its points look to be.
        there = pycolmap.Rigid3d(pycolmap.Rotation3d(), np.array([sideways, 0.0, 0.0]))
        relative = self.poses[second] * there * self.poses[first].inverse()
        geometry = pycolmap.TwoViewGeometry(
            config=pycolmap.TwoViewGeometryConfiguration.CALIBRATED,
            E=pycolmap.essential_matrix_from_pose(relative),
            cam2_from_cam1=relative,
            inlier_matches=matches,
            tri_angle=0.3,
        )
        return PairGeometry(*image_ids, matches, geometry)

    def view_graph(self, *, true_pairs: bool = False) -> ViewGraph:
        """All photos, image ids counted from 1, with all pairs; or as if nothing were alike."""
        shifts = (0.0,) if true_pairs else _SHIFTS
        graph = ViewGraph()
        for index in range(NUM_PHOTOS):
            keypoints = np.zeros((len(self.ids[index]), 4), np.float32)
            keypoints[:, :2] = self.pixels[index]
            found = [self.pair(index, j, (index + 1, j + 1), shifts) for j in range(index)]
            pairs = [pair for pair in found if pair is not None]
            graph.add(index + 1, f"{index:02d}.jpg", self.camera, keypoints, pairs)
        return graph

    def model(self, *, folded: bool = False, drift: float = 0.0) -> pycolmap.Reconstruction:
        """The true model; or the one in which the two things are one, and the last photos, which
        see the second, stand before the first. With ``drift`` the last photos stand, and see what
        they see, so far below where it is; only a few points are those that the others see too."""
        model = pycolmap.Reconstruction()
        model.add_camera_with_trivial_rig(self.camera)
        moved = self.offset if folded else np.array([0.0, 0.0, drift])
        back = pycolmap.Rigid3d(pycolmap.Rotation3d(), moved)
        tracks: dict[tuple[bool, int], pycolmap.Track] = {}
        for index, pose in enumerate(self.poses):
            late = moved.any() and 2 * index >= NUM_PHOTOS
            image = pycolmap.Image(
                name=f"{index:02d}.jpg",
                keypoints=self.pixels[index],
                camera_id=1,
                image_id=index + 1,
            )
            model.add_image_with_trivial_frame(image, pose * back if late else pose)
            for keypoint, point in enumerate(self.ids[index].tolist()):
                # Each half has its own copy of what stands between; of a few things if it drifted.
                if folded and late and _is_second(point):
                    name = False, point - _NUM_ALIKE
                else:
                    name = late and (folded or point % _ONE_IN > 0), point
                tracks.setdefault(name, pycolmap.Track()).add_element(index + 1, keypoint)
        for (late, point), track in tracks.items():
            place = self.points[point] - (moved if late else 0)
            if track.length() >= 2:
                model.add_point3D(place, track, np.zeros(3, np.uint8))
        return model


def _is_second(point: int) -> bool:
    return _NUM_ALIKE <= point < 2 * _NUM_ALIKE

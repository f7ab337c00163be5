"""Photos of synthetic scenes, in the form a session handles them, for tests."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
import pycolmap

from sfm_front.evaluation.synthetic.scene import SyntheticScene, as_described
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.mapping.view_graph import ViewGraph
from sfm_front.types import ExtractedPhoto, Features, Float64Array, PairGeometry, View

MIN_SHARED_POINTS = 30

_VLAD = Vlad()


def described(scene: SyntheticScene, index: int, *, prefix: str = "") -> ExtractedPhoto:
    """Photo ``index`` as if it had been read and extracted."""
    photo = scene.photo(index)
    named = replace(photo, name=prefix + photo.name)
    return as_described(named, scene.camera, _VLAD.describe(photo.features))


def view_of(scene: SyntheticScene, index: int, image_id: int) -> View:
    """Photo ``index`` with the true camera."""
    return View(image_id, scene.camera, scene.photo(index).features)


def true_matches(scene: SyntheticScene, first: int, second: int) -> np.ndarray:
    """(M, 2) uint32: indices of keypoints of two photos that show the same scene point."""
    ids = [scene.photo(index).point_ids for index in (first, second)]
    shown = [np.flatnonzero(of_photo >= 0) for of_photo in ids]
    _, in_first, in_second = np.intersect1d(
        ids[0][shown[0]], ids[1][shown[1]], assume_unique=True, return_indices=True
    )
    return np.column_stack([shown[0][in_first], shown[1][in_second]]).astype(np.uint32)


def true_pair(scene: SyntheticScene, first: int, second: int, ids: tuple[int, int]) -> PairGeometry:
    """The pair as perfect verification returns it."""
    matches = true_matches(scene, first, second)
    poses = [scene.cams_from_world[index] for index in (first, second)]
    points = scene.points[scene.photo(first).point_ids[matches[:, 0]]]
    to_first, to_second = (points - centre_of(pose) for pose in poses)
    cosine = np.einsum("nd,nd->n", to_first, to_second) / (
        np.linalg.norm(to_first, axis=1) * np.linalg.norm(to_second, axis=1)
    )
    cam2_from_cam1 = poses[1] * poses[0].inverse()
    geometry = pycolmap.TwoViewGeometry(
        config=pycolmap.TwoViewGeometryConfiguration.CALIBRATED,
        E=pycolmap.essential_matrix_from_pose(cam2_from_cam1),
        cam2_from_cam1=cam2_from_cam1,
        inlier_matches=matches,
        tri_angle=float(np.median(np.arccos(np.clip(cosine, -1, 1)))),
    )
    return PairGeometry(*ids, matches, geometry)


def centre_of(cam_from_world: pycolmap.Rigid3d) -> Float64Array:
    """Projection centre, (3,), in world coordinates."""
    return np.asarray(cam_from_world.inverse().translation)


class SceneFeed:
    """Adds photos of a synthetic scene to a ``ViewGraph``, with their true pairs with earlier ones.

    A photo gets the next free image id, counted from 1, and its name after ``prefix``. With a
    ``max_distance``, photos farther apart in the order of the scene have no pair; nor have those
    that are not ``linked``.
    """

    def __init__(
        self,
        synthetic: SyntheticScene,
        scene: ViewGraph | None = None,
        *,
        prefix: str = "",
        max_distance: int | None = None,
        linked: Callable[[int, int], bool] = lambda index, other: True,  # noqa: ARG005
    ) -> None:
        self.synthetic = synthetic
        self.scene = ViewGraph() if scene is None else scene
        self._prefix = prefix
        self._max_distance = len(synthetic) if max_distance is None else max_distance
        self._linked = linked
        self.index_of: dict[int, int] = {}
        self.camera = pycolmap.Camera(synthetic.camera.todict())

    def add(self, index: int) -> int:
        """Add photo ``index``; returns its image id."""
        image_id = len(self.scene) + 1
        pairs = [
            self.pair(index, other, (image_id, other_id))
            for other_id, other in self.index_of.items()
            if abs(index - other) <= self._max_distance
            and self._linked(index, other)
            and len(true_matches(self.synthetic, index, other)) >= MIN_SHARED_POINTS
        ]
        photo = self.synthetic.photo(index)
        name = self._prefix + photo.name
        self.scene.add(image_id, name, self.camera, photo.features.keypoints, pairs)
        self.index_of[image_id] = index
        return image_id

    def pair(self, index: int, other: int, ids: tuple[int, int]) -> PairGeometry:
        """What verification says of a photo and an earlier one."""
        return true_pair(self.synthetic, index, other, ids)

    def use_another_camera(self) -> None:
        """Give further photos a second camera with the same parameters."""
        self.camera = pycolmap.Camera(self.synthetic.camera.todict())
        self.camera.camera_id += 1

    def add_all(self, indices: Iterable[int]) -> list[int]:
        return [self.add(index) for index in indices]


def position_errors_m(
    model: pycolmap.Reconstruction, scene: SyntheticScene, *, prefix: str = ""
) -> Float64Array:
    """(N,) distance of each registered photo from its true place, after alignment by the
    similarity that fits best."""
    known = {prefix + scene.name(index): index for index in range(len(scene))}
    images = [model.images[image_id] for image_id in model.reg_image_ids()]
    found = np.array([image.projection_center() for image in images])
    truth = np.array([centre_of(scene.cams_from_world[known[image.name]]) for image in images])
    truth_from_model = pycolmap.estimate_sim3d(found, truth)
    assert truth_from_model is not None
    return np.linalg.norm(truth_from_model * found - truth, axis=1)


def registered_names(models: Sequence[pycolmap.Reconstruction]) -> set[str]:
    return {model.images[i].name for model in models for i in model.reg_image_ids()}


def no_features() -> Features:
    return Features(
        np.zeros((0, 4), np.float32), np.zeros((0, 128), np.uint8), np.zeros((0, 3), np.uint8)
    )

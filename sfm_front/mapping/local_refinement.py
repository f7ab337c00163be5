"""Local bundle adjustment around the newest photos of a model."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

import pycolmap

from sfm_front.errors import ConfigError
from sfm_front.mapping.taking_over import take_over

Part = Callable[
    [pycolmap.Reconstruction, Collection[int], Collection[int]], pycolmap.Reconstruction
]
"""Model, photos and points → a model of these and of what is around them."""


@dataclass(frozen=True, kw_only=True)
class LocalRefinementOptions:
    """How the neighbourhood of new photos is refined."""

    # A model of this many photos refines two new ones at a time, of twice as many three: keeps the
    # cost per photo constant (TUNING: local-batch).
    photos_per_batch: int = 250
    # No more than this many at a time: those that wait are where others put them, and what comes
    # next does not fit them. From the model that would take more on, the neighbourhood is refined
    # apart from it.
    max_batch: int = 4
    # Points in more photos than this stay fixed: they hardly move, and would pull all photos in.
    max_track_length: int = 15

    def __post_init__(self) -> None:
        for name in ("photos_per_batch", "max_batch", "max_track_length"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")

    def batch_size(self, num_images: int) -> int:
        """Number of new photos that share a local refinement in a model of this size."""
        return min(self.max_batch, 1 + num_images // self.photos_per_batch)

    def is_apart(self, num_images: int) -> bool:
        """Whether the neighbourhood is refined apart from a model of this size."""
        return num_images >= self.max_batch * self.photos_per_batch


class LocalRefinement:
    """COLMAP's local refinement, per photo or, in a large model, per batch of photos.

    COLMAP first checks the whole model for consistency, which takes longer as it grows. A batch
    shares that check, so that the cost per photo stays constant (TUNING: local-batch). In a huge
    one the neighbourhood is taken out, refined as a model of its own, and put back: with the same
    result, for what is around it stands fixed either way.
    """

    def __init__(
        self,
        pipeline: pycolmap.IncrementalPipelineOptions,
        options: LocalRefinementOptions | None = None,
        part: Part | None = None,
    ) -> None:
        """``part``: as ``ViewGraph.part``; without, nothing is taken out."""
        self._part = part
        self._options = options or LocalRefinementOptions()
        self._mapping = pipeline.get_mapper()
        self._triangulation = pipeline.get_triangulation()
        self._adjustment = pipeline.get_local_bundle_adjustment()
        self._waiting: list[int] = []
        self.held_cameras: Collection[int] = ()

    def add(self, mapper: pycolmap.IncrementalMapper, image_id: int) -> None:
        """Refine around a newly registered and triangulated photo, now or with its batch."""
        self._waiting.append(image_id)
        num_images = mapper.reconstruction.num_reg_images()
        if len(self._waiting) >= self._options.batch_size(num_images):
            self._refine(mapper)
            self.forget(mapper)

    def forget(self, mapper: pycolmap.IncrementalMapper) -> None:
        """Drop what waits: the model has just been refined."""
        self._waiting.clear()
        mapper.clear_modified_points3D()

    def _refine(self, mapper: pycolmap.IncrementalMapper) -> None:
        around = {i for new in self._waiting for i in mapper.find_local_bundle(self._mapping, new)}
        bundle = around.union(self._waiting)
        modified = mapper.get_modified_points3D()
        if around:
            short = {i for i in modified if self._is_short(mapper.reconstruction.point3D(i))}
            self._adjust(mapper, bundle, short)
            mapper.triangulator.merge_tracks(self._triangulation, short)
            mapper.triangulator.complete_tracks(self._triangulation, short)
            for image_id in self._waiting:
                mapper.triangulator.complete_image(self._triangulation, image_id)
        limits = (self._mapping.filter_max_reproj_error, self._mapping.filter_min_tri_angle)
        mapper.observation_manager.filter_points3D_in_images(*limits, bundle)
        mapper.observation_manager.filter_points3D(*limits, modified)

    def _adjust(
        self, mapper: pycolmap.IncrementalMapper, bundle: set[int], points: set[int]
    ) -> None:
        """Cameras stay fixed if they are held, or photos outside the bundle share them."""
        model = mapper.reconstruction
        config = pycolmap.BundleAdjustmentConfig()
        config.fix_gauge(pycolmap.BundleAdjustmentGauge.THREE_POINTS)
        in_bundle: dict[int, int] = {}
        for image_id in sorted(bundle):
            config.add_image(image_id)
            camera_id = model.image(image_id).camera_id
            in_bundle[camera_id] = in_bundle.get(camera_id, 0) + 1
        for camera_id, count in in_bundle.items():
            is_shared = count < mapper.num_reg_images_per_camera[camera_id]
            if is_shared or camera_id in self.held_cameras:
                config.set_constant_cam_intrinsics(camera_id)
        for point_id in points:
            config.add_variable_point(point_id)
        if self._part is None or not self._options.is_apart(model.num_reg_images()):
            pycolmap.create_default_bundle_adjuster(self._adjustment, config, model).solve()
            return
        apart = self._part(model, bundle, points)
        pycolmap.create_default_bundle_adjuster(self._adjustment, config, apart).solve()
        # Photos around it stood fixed: they are as they were.
        take_over(model, apart)

    def _is_short(self, point: pycolmap.Point3D) -> bool:
        return not point.has_error() or point.track.length() <= self._options.max_track_length

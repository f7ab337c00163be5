"""A synthetic flight through one process, and through a cluster: how long, and how well.

Its photos have features, but no pixels: one process is given them; for workers they lie in the
cache of features, as if an earlier run had described the photos.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from sfm_front.cluster.connection import connected
from sfm_front.cluster.coordinator import ClusterProgress, Coordinator
from sfm_front.cluster.options import ClusterOptions
from sfm_front.cluster.workbench import extraction_settings
from sfm_front.cluster.working_folder import WorkingFolder
from sfm_front.evaluation.gps import gps_residual_m
from sfm_front.evaluation.poses import auc, pose_errors
from sfm_front.evaluation.synthetic.positions import measured_positions
from sfm_front.evaluation.synthetic.scene import SyntheticScene, as_described
from sfm_front.features.feature_cache import CachedFeatures, FeatureCache
from sfm_front.features.global_descriptors.descriptor import resolve
from sfm_front.photos.reader import file_digest
from sfm_front.session.given import GivenSession
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session
from sfm_front.session.summing_up import SessionResult
from sfm_front.types import ExtractedPhoto, PhotoPath


@dataclass(frozen=True, slots=True)
class FlightResult:
    """``seconds``: wall time from the first photo, or the start of the workers, to the written
    models. ``num_registered``: of the largest model. ``auc``: of the pose errors of all pairs, at
    1, 3 and 5 degrees, in [0, 1]. ``gps_residual_m``: median distance from the positions; None
    without any."""

    seconds: float
    num_registered: int
    num_models: int
    auc: tuple[float, ...]
    gps_residual_m: float | None


class Flight:
    """A synthetic scene whose photos are described."""

    def __init__(
        self, scene: SyntheticScene, options: SessionOptions, gps_noise_m: float | None
    ) -> None:
        """``gps_noise_m``: as ``measured_positions`` takes it."""
        self._scene = scene
        self._options = options
        self._descriptor, _ = resolve(options.global_descriptor)
        positions = measured_positions(scene, gps_noise_m)
        self._photos: list[ExtractedPhoto] = []
        self._positions = {}
        for index, position in enumerate(positions):
            seen = scene.photo(index)
            vector = self._descriptor.describe(np.empty(0, np.uint8), seen.features)
            self._photos.append(as_described(seen, scene.camera, vector, position))
            if position is not None:
                self._positions[seen.name] = position

    def through_one_process(self, output: Path, note: Callable[[str], None]) -> FlightResult:
        """Photo by photo through a session."""
        started = perf_counter()
        with Session(output, self._options) as session:
            for number, photo in enumerate(self._photos, start=1):
                session.add_extracted(photo)
                note(f"photo {number} of {len(self._photos)}")
            result = session.finish()
        return self._judged(result, perf_counter() - started)

    def through_cluster(
        self, output: Path, folder: Path, options: ClusterOptions, note: Callable[[str], None]
    ) -> FlightResult:
        """On workers, which read the photos' files in ``folder``: they are made here, with nothing
        in them but their names."""
        with GivenSession(output, self._options) as session:
            files = self._laid_out(WorkingFolder(output).features, folder)

            def tell(now: ClusterProgress) -> None:
                note(f"{now.num_matched} matched, {now.num_grown} of {now.num_groups} groups grown")

            started = perf_counter()
            with connected(options, note) as cluster:
                coordinator = Coordinator(session, cluster, options, files, tell)
                result = coordinator.run(lambda: False)
                seconds = perf_counter() - started
        return self._judged(result, seconds)

    def _laid_out(self, cache: FeatureCache, folder: Path) -> list[PhotoPath]:
        """Files that workers take for the photos, whose features they find."""
        settings = extraction_settings(self._options, self._descriptor)
        files = [PhotoPath(photo.name, folder / photo.name) for photo in self._photos]
        for photo, file in zip(self._photos, files, strict=True):
            file.path.write_bytes(photo.name.encode())
            digest = file_digest(file.path, file.name)
            assert isinstance(digest, str)
            keys = settings.keys(digest)
            cache.save_vector(keys.vectors[0], photo.global_vector)
            local = CachedFeatures(photo.width, photo.height, photo.exif, photo.features)
            cache.save_local(keys.features, local)
        return files

    def _judged(self, result: SessionResult, seconds: float) -> FlightResult:
        models = [model.reconstruction for model in result.models]
        largest = max(models, key=lambda model: model.num_reg_images(), default=None)
        return FlightResult(
            seconds=seconds,
            num_registered=0 if largest is None else int(largest.num_reg_images()),
            num_models=len(models),
            auc=tuple(auc(pose_errors(self._scene.truth(), models))),
            gps_residual_m=None if largest is None else gps_residual_m(largest, self._positions),
        )

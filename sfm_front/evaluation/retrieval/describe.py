"""Photos of a dataset → BenchPhotos, from the cache if they were described before."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from sfm_front.errors import ConfigError
from sfm_front.evaluation.retrieval.perceptual_hash import PerceptualHash, packed
from sfm_front.evaluation.retrieval.types import BenchPhoto, Query
from sfm_front.features.cached_extraction import CachedExtraction, CachedPhoto
from sfm_front.features.feature_cache import Box
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.sift import SiftExtractor, SiftOptions
from sfm_front.photos.cameras import CameraCatalog
from sfm_front.photos.reader import PhotoReader
from sfm_front.types import PhotoPath, Skipped, View

Progress = Callable[[int, int], None]
"""Called with the number of photos done and the total."""


@dataclass(frozen=True, slots=True, eq=False)
class Described:
    """``photos`` by name, in the order given; ``skipped`` are unusable files."""

    photos: Mapping[str, BenchPhoto]
    skipped: tuple[Skipped, ...]


class BenchExtraction:
    """Computes what any method needs of a photo; image ids count up from 1."""

    def __init__(
        self,
        cache: Path,
        descriptors: Mapping[str, GlobalDescriptor],
        *,
        max_image_size: int = 1600,
        max_features: int = SiftOptions.max_features,
        num_threads: int = 1,
    ) -> None:
        """``cache``: a folder, created if missing, which datasets and settings may share.

        ``descriptors``: those to compute, by their name in ``BenchPhoto.vectors``;
        ``features.global_descriptors.descriptor.resolve`` makes them.
        """
        if PerceptualHash.name in descriptors:
            raise ConfigError(f"every photo has a {PerceptualHash.name}: do not ask for it")
        hashing = GlobalDescriptor(networks=[PerceptualHash()])
        self._describer = CachedExtraction(
            cache,
            PhotoReader(max_image_size=max_image_size),
            SiftExtractor(SiftOptions(max_features=max_features)),
            {**descriptors, PerceptualHash.name: hashing},
        )
        self._num_threads = num_threads
        self._cameras = CameraCatalog()
        self._ids = count(1)

    def photos(self, photos: Mapping[str, Path], progress: Progress | None = None) -> Described:
        """Describe photos by name. Raises InputError if the cache cannot be written to."""
        return self._describe(photos, {}, progress)

    def queries(
        self,
        queries: Iterable[Query],
        photos: Mapping[str, Path],
        progress: Progress | None = None,
    ) -> Described:
        """Describe queries, by their own names, each cropped to its box if it has one."""
        queries = list(queries)
        return self._describe(
            {query.name: photos[query.photo] for query in queries},
            {query.name: query.box for query in queries if query.box is not None},
            progress,
        )

    def _describe(
        self, paths: Mapping[str, Path], boxes: Mapping[str, Box], progress: Progress | None
    ) -> Described:
        described = self._describer.stream(
            (PhotoPath(name, path) for name, path in paths.items()),
            boxes,
            num_threads=self._num_threads,
        )
        photos: dict[str, BenchPhoto] = {}
        skipped: list[Skipped] = []
        for done, photo in enumerate(described, 1):
            if isinstance(photo, Skipped):
                skipped.append(photo)
            else:
                photos[photo.photo.name] = self._bench_photo(photo)
            if progress is not None:
                progress(done, len(paths))
        return Described(photos, tuple(skipped))

    def _bench_photo(self, recalled: CachedPhoto) -> BenchPhoto:
        camera = self._cameras.camera_for(recalled.photo).camera
        vectors = dict(recalled.vectors)
        perceptual_hash = packed(vectors.pop(PerceptualHash.name))
        view = View(next(self._ids), camera, recalled.photo.features)
        return BenchPhoto(view, vectors, perceptual_hash)

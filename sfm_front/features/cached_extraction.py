"""Photos → features and global vectors, in parallel and cached on disk."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sfm_front.features.colmap_sift import ColmapSift
from sfm_front.features.feature_cache import (
    Box,
    CachedFeatures,
    CacheKeys,
    ExtractionSettings,
    FeatureCache,
)
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.sift import SiftExtractor
from sfm_front.photos.reader import PhotoReader, file_digest
from sfm_front.runtime.prefetch import prefetch
from sfm_front.types import (
    ExtractedPhoto,
    Features,
    Float32Array,
    Photo,
    PhotoPath,
    Skipped,
    SkipReason,
)


@dataclass(frozen=True, slots=True, eq=False)
class CachedPhoto:
    """An extracted photo and its global vectors by descriptor name.

    ``photo.global_vector`` is the first descriptor's.
    """

    photo: ExtractedPhoto
    vectors: Mapping[str, Float32Array]


class CachedExtraction:
    """Extracts features and global vectors, reusing those cached in its folder. Thread-safe."""

    def __init__(
        self,
        folder: Path,
        reader: PhotoReader,
        sift: SiftExtractor | ColmapSift,
        descriptors: Mapping[str, GlobalDescriptor],
    ) -> None:
        self.files = FeatureCache(folder)
        self._reader = reader
        self._sift = sift
        self._descriptors = dict(descriptors)
        self.settings = ExtractionSettings(
            reader.max_image_size,
            reader.min_image_size,
            sift.fingerprint,
            tuple(descriptor.fingerprint for descriptor in self._descriptors.values()),
        )

    def describe(
        self, photo: PhotoPath, box: Box | None = None, *, digest: str | None = None
    ) -> CachedPhoto | Skipped:
        """Describe a photo, or the part of it in ``box``; keypoints are in pixels of the file.

        ``digest``: the file's, if already known. Raises InputError if the folder cannot be
        written to.
        """
        known = digest or file_digest(photo.path, photo.name)
        if isinstance(known, Skipped):
            return known
        digest = known
        keys = self.settings.keys(digest, box)
        local = self.files.load_local(keys.features)
        vectors = self.files.load_vectors(keys)
        if local is None or vectors is None:
            made = self._make(photo, box, keys)
            if isinstance(made, Skipped):
                return made
            local, vectors = made
        described = ExtractedPhoto(
            name=photo.name,
            path=photo.path,
            width=local.width,
            height=local.height,
            digest=digest,
            exif=local.exif,
            features=local.features,
            global_vector=vectors[0] if vectors else np.zeros(0, np.float32),
        )
        return CachedPhoto(described, dict(zip(self._descriptors, vectors, strict=True)))

    def stream(
        self,
        photos: Iterable[PhotoPath],
        boxes: Mapping[str, Box] | None = None,
        *,
        num_threads: int,
    ) -> Iterator[CachedPhoto | Skipped]:
        """Describe photos in order, ``num_threads`` at a time; ``boxes`` by photo name."""

        def describe(photo: PhotoPath) -> CachedPhoto | Skipped:
            return self.describe(photo, None if boxes is None else boxes.get(photo.name))

        return prefetch(describe, photos, num_threads=num_threads)

    def _make(
        self, photo: PhotoPath, box: Box | None, keys: CacheKeys
    ) -> tuple[CachedFeatures, list[Float32Array]] | Skipped:
        """Compute what is not cached yet of a photo's description, and cache it."""
        read = self._reader.read(photo.path, photo.name)
        if isinstance(read, Skipped):
            return read
        part, offset = (read, (0.0, 0.0)) if box is None else crop(read, box)
        local = self.files.load_local(keys.features)
        if local is None:
            features = _moved(self._sift.extract(part), offset)
            if len(features) == 0:
                return Skipped(photo.name, SkipReason.NO_FEATURES, "no texture to hold on to")
            local = CachedFeatures(read.width, read.height, read.exif, features)
            self.files.save_local(keys.features, local)
        vectors = []
        for key, descriptor in zip(keys.vectors, self._descriptors.values(), strict=True):
            vector = self.files.load_vector(key)
            if vector is None:
                vector = descriptor.describe(part.pixels, local.features)
                self.files.save_vector(key, vector)
            vectors.append(vector)
        return local, vectors


def crop(photo: Photo, box: Box) -> tuple[Photo, tuple[float, float]]:
    """Crop a photo to ``box``; returns the crop and its left and top in pixels of the file.

    The crop has at least one working pixel; its ``width`` and ``height`` are in pixels of the file.
    """
    height, width = photo.pixels.shape[:2]
    per_column, per_row = photo.width / width, photo.height / height
    left, right = _inside(box[0] / per_column, box[2] / per_column, width)
    top, bottom = _inside(box[1] / per_row, box[3] / per_row, height)
    part = replace(
        photo,
        pixels=np.ascontiguousarray(photo.pixels[top:bottom, left:right]),
        width=round((right - left) * per_column),
        height=round((bottom - top) * per_row),
    )
    return part, (left * per_column, top * per_row)


def _inside(start: float, end: float, size: int) -> tuple[int, int]:
    first = min(max(round(start), 0), size - 1)
    return first, min(max(round(end), first + 1), size)


def _moved(features: Features, offset: tuple[float, float]) -> Features:
    keypoints = features.keypoints.copy()
    keypoints[:, :2] += np.asarray(offset, np.float32)
    return replace(features, keypoints=keypoints)

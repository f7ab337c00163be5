"""Features between coordinator and workers: by path where both see one folder, else sent."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from pathlib import Path

from sfm_front.cluster.work import DescribedPhoto, PhotoFile
from sfm_front.errors import StorageError
from sfm_front.features.feature_cache import CachedFeatures, ExtractionSettings, FeatureCache
from sfm_front.storage.database import PhotoDatabase
from sfm_front.types import Exif, ExtractedPhoto, Features, PhotoPath


class FeatureStore:
    """All features go through a cache in the output, which outlives the coordinator."""

    def __init__(
        self,
        cache: FeatureCache,
        settings: ExtractionSettings,
        database: PhotoDatabase,
        *,
        is_shared: bool,
        sees_photos: bool,
    ) -> None:
        """``is_shared``: workers read and write the cache themselves; ``sees_photos``: they read
        photos by their paths."""
        self._cache = cache
        self._settings = settings
        self._database = database
        self._is_shared = is_shared
        self._sees_photos = sees_photos
        self._keys: dict[int, str] = {}

    def know(self, image_id: int, digest: str) -> None:
        """A photo has this image id."""
        self._keys[image_id] = self._settings.keys(digest).features

    def file_of(self, photo: PhotoPath) -> PhotoFile:
        """What a worker needs to describe it."""
        if self._sees_photos:
            return PhotoFile(photo.name, photo.path.absolute())
        try:
            return PhotoFile(photo.name, photo.path, photo.path.read_bytes())
        except OSError:
            return PhotoFile(photo.name, photo.path, b"")  # it will be said to be empty

    def taken(self, photo: DescribedPhoto, path: Path) -> ExtractedPhoto:
        """A photo that a worker has described; ``path``: here. Raises StorageError if its features
        are gone."""
        keys = self._settings.keys(photo.digest)
        local, vector = photo.local, photo.vector
        if local is not None and vector is not None:
            self._cache.save_vector(keys.vectors[0], vector)
            self._cache.save_local(keys.features, local)
        else:
            local = self._cache.load_local(keys.features)
            vector = self._cache.load_vector(keys.vectors[0])
        if local is None or vector is None:
            raise StorageError(f"{photo.name}: its features were removed from the output meanwhile")
        return ExtractedPhoto(
            name=photo.name,
            path=path,
            width=local.width,
            height=local.height,
            digest=photo.digest,
            exif=local.exif,
            features=local.features,
            global_vector=vector,
            seconds=dict(photo.seconds),
        )

    def for_workers(self, image_ids: Collection[int]) -> tuple[dict[int, str], dict[int, Features]]:
        """Cache keys of these photos, and their features where the cache is not shared."""
        if not self._is_shared:
            return {}, {image_id: self._features(image_id) for image_id in image_ids}
        return {image_id: self._cached(image_id) for image_id in image_ids}, {}

    def _features(self, image_id: int) -> Features:
        local = self._cache.load_local(self._keys[image_id])
        return self._database.features(image_id) if local is None else local.features

    def _cached(self, image_id: int) -> str:
        """The key of a photo. One of an earlier run, whose cache has been removed since, gets
        another: who describes its file again must not find it."""
        key = self._keys[image_id]
        if not self._cache.has_local(key):
            key = self._keys[image_id] = hashlib.blake2b(key.encode(), digest_size=16).hexdigest()
            stored = CachedFeatures(0, 0, Exif(), self._database.features(image_id))
            self._cache.save_local(key, stored)
        return key

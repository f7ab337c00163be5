"""On a worker: photos → features and global vectors, in the cache or in the answer."""

from __future__ import annotations

import tempfile
from pathlib import Path

from sfm_front.cluster.work import Described, DescribedPhoto, PhotoFile
from sfm_front.cluster.workbench import Counts, Workbench
from sfm_front.features.feature_cache import CachedFeatures
from sfm_front.photos.reader import file_digest
from sfm_front.types import PhotoPath, Skipped


def describe(bench: Workbench, work: tuple[PhotoFile, ...], counts: Counts) -> list[Described]:
    """Each photo as a session does it, unless it lies in the shared cache."""
    return [_describe(bench, photo, counts) for photo in work]


def _describe(bench: Workbench, photo: PhotoFile, counts: Counts) -> Described:
    counts.items += 1
    if photo.content is None:
        counts.bytes_in += photo.path.stat().st_size if photo.path.is_file() else 0
        return _described(bench, PhotoPath(photo.name, photo.path), counts)
    with tempfile.TemporaryDirectory(prefix="sfm_front_") as folder:
        # The name is whatever the sender's disk allows: only what says the format is kept.
        path = Path(folder) / f"photo{photo.path.suffix}"
        path.write_bytes(photo.content)
        return _described(bench, PhotoPath(photo.name, path), counts)


def _described(bench: Workbench, photo: PhotoPath, counts: Counts) -> Described:
    cache = bench.cache
    if cache is not None:
        digest = file_digest(photo.path, photo.name)
        if isinstance(digest, Skipped):
            return digest
        if cache.has(bench.keys.keys(digest)):
            counts.reused += 1
            return DescribedPhoto(photo.name, digest, {}, reused=True)
    made = bench.extraction.describe(photo)
    if isinstance(made, Skipped):
        return made
    local = CachedFeatures(made.width, made.height, made.exif, made.features)
    if cache is None:
        return DescribedPhoto(
            photo.name, made.digest, made.seconds, False, local, made.global_vector
        )
    keys = bench.keys.keys(made.digest)
    cache.save_vector(keys.vectors[0], made.global_vector)
    cache.save_local(keys.features, local)
    counts.bytes_out += made.features.num_bytes + made.global_vector.nbytes
    return DescribedPhoto(photo.name, made.digest, made.seconds, reused=False)

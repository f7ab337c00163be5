"""Features and global vectors on disk, keyed by everything they depend on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import datetime
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sfm_front.storage.array_files import ArrayFiles, Arrays
from sfm_front.types import Exif, Features, Float32Array, GeoPosition, GimbalAngles

Box = tuple[float, float, float, float]
"""Left, top, right and bottom in pixels of the file."""

_FORMAT = 2
_DECISIVE_CODE = (
    "photos/decoding.py",
    "photos/exif.py",
    "photos/formats.py",
    "photos/xmp.py",
    "features/colmap_sift.py",
    "features/sift.py",
    "features/global_descriptors/vlad.py",
    "features/global_descriptors/visual_words.py",
    "features/global_descriptors/unit_vectors.py",
    "features/global_descriptors/cnn.py",
    "features/global_descriptors/networks.py",
    "features/global_descriptors/descriptor.py",
)


@dataclass(frozen=True, slots=True, eq=False)
class CachedFeatures:
    """Size of a photo in pixels of the file, its EXIF, and its SIFT features."""

    width: int
    height: int
    exif: Exif
    features: Features


@dataclass(frozen=True, slots=True)
class CacheKeys:
    """Cache keys of a photo: of its features, and of one vector per descriptor."""

    features: str
    vectors: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ExtractionSettings:
    """Everything that features and vectors depend on besides the photo's bytes.

    ``extractor``: fingerprint of the SIFT extractor; ``fingerprints``: the global descriptors'.
    """

    max_image_size: int
    min_image_size: int
    extractor: str
    fingerprints: tuple[str, ...]

    def keys(self, digest: str, box: Box | None = None) -> CacheKeys:
        """Keys of the photo with this ``digest``, or of its part in ``box``."""
        # Another release of OpenCV may find other keypoints.
        local = (
            _FORMAT,
            _code_digest(),
            cv2.__version__,
            self.max_image_size,
            self.min_image_size,
            self.extractor,
            digest,
            box,
        )
        return CacheKeys(
            _key(local), tuple(_key((*local, fingerprint)) for fingerprint in self.fingerprints)
        )


class FeatureCache:
    """A cache folder that sessions, settings and descriptors may share."""

    def __init__(self, folder: Path) -> None:
        self._features = ArrayFiles(folder / "features")
        self._vectors = ArrayFiles(folder / "vectors")

    def has(self, keys: CacheKeys) -> bool:
        """Whether features and every vector have a file; it may be damaged."""
        return self._features.has(keys.features) and all(map(self._vectors.has, keys.vectors))

    def has_local(self, key: str) -> bool:
        """Whether features have a file; it may be damaged."""
        return self._features.has(key)

    def load_local(self, key: str) -> CachedFeatures | None:
        """None where there is none, or the file is damaged."""
        arrays = self._features.load(key)
        try:
            return None if arrays is None else _unpacked(arrays)
        except (KeyError, ValueError, TypeError):
            return None

    def save_local(self, key: str, local: CachedFeatures) -> None:
        features = local.features
        about = {"width": local.width, "height": local.height, "exif": asdict(local.exif)}
        self._features.save(
            key,
            {
                "keypoints": features.keypoints,
                "descriptors": features.descriptors,
                "colors": features.colors,
                "about": np.frombuffer(json.dumps(about, default=_to_json).encode(), np.uint8),
            },
        )

    def load_vector(self, key: str) -> Float32Array | None:
        """None where there is none, or the file is damaged."""
        arrays = self._vectors.load(key)
        vector = None if arrays is None else arrays.get("vector")
        return None if vector is None or vector.dtype != np.float32 else vector

    def load_vectors(self, keys: CacheKeys) -> list[Float32Array] | None:
        """All vectors of a photo; None if any is absent or damaged."""
        vectors = [self.load_vector(key) for key in keys.vectors]
        there = [vector for vector in vectors if vector is not None]
        return there if len(there) == len(vectors) else None

    def save_vector(self, key: str, vector: Float32Array) -> None:
        self._vectors.save(key, {"vector": vector})

    def keep_only(self, kept: Iterable[CacheKeys]) -> None:
        """Remove all other entries."""
        kept = list(kept)
        self._features.keep_only({keys.features for keys in kept})
        self._vectors.keep_only({key for keys in kept for key in keys.vectors})


@lru_cache
def _code_digest() -> str:
    """Hash of the code that computes features and vectors. A version number bumped by hand would
    be forgotten, and features of different code do not match."""
    digest = hashlib.blake2b(digest_size=16)
    for name in _DECISIVE_CODE:
        digest.update(files("sfm_front").joinpath(name).read_bytes())
    return digest.hexdigest()


def _key(parts: tuple[Any, ...]) -> str:
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def _to_json(value: object) -> str:
    if isinstance(value, datetime):
        return value.isoformat()
    raise TypeError(f"{type(value).__name__} is nothing that EXIF holds")


def _unpacked(arrays: Arrays) -> CachedFeatures:
    about = json.loads(arrays["about"].tobytes())
    exif = about["exif"]
    if exif["captured_at"] is not None:
        exif["captured_at"] = datetime.fromisoformat(exif["captured_at"])
    if exif["position"] is not None:
        exif["position"] = GeoPosition(**exif["position"])
    if exif["gimbal"] is not None:
        exif["gimbal"] = GimbalAngles(**exif["gimbal"])
    keypoints, descriptors, colors = (
        _checked(arrays[name], dtype, columns)
        for name, dtype, columns in (
            ("keypoints", np.float32, 4),
            ("descriptors", np.uint8, 128),
            ("colors", np.uint8, 3),
        )
    )
    if not len(keypoints) == len(descriptors) == len(colors):
        raise ValueError("keypoints, descriptors and colors differ in number")
    features = Features(keypoints, descriptors, colors)
    return CachedFeatures(about["width"], about["height"], Exif(**exif), features)


def _checked(array: NDArray[Any], dtype: type, columns: int) -> NDArray[Any]:
    if array.dtype != dtype or array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"{array.shape} {array.dtype}")
    return array

"""SIFT keypoints and RootSIFT descriptors of a photo."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.types import DESCRIPTOR_NORM, Features, Float32Array, Photo, Uint8Array


@dataclass(frozen=True, kw_only=True)
class SiftOptions:
    """Which keypoints of a photo are found and kept."""

    # Keypoint locations kept per photo; one with several orientations counts once, as in COLMAP.
    max_features: int = 4000
    # Keypoints described, by response, per keypoint kept, by scale.
    described_per_kept: int = 4
    # Fewest pixels, at working size, of a photo that has enough keypoints above the higher
    # contrast threshold (TUNING: small-photo-contrast).
    large_photo_px: int = 1_000_000
    # OpenCV's contrast threshold in a large photo; the higher, the fewer faint keypoints.
    contrast_threshold: float = 0.04
    # The same in a smaller photo, which has few keypoints: COLMAP's.
    small_photo_contrast_threshold: float = 0.02

    def __post_init__(self) -> None:
        for name in ("max_features", "described_per_kept"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")
        if self.large_photo_px < 0:
            raise ConfigError(f"large_photo_px must not be negative, got {self.large_photo_px}")
        for name in ("contrast_threshold", "small_photo_contrast_threshold"):
            if not 0 < getattr(self, name) < 1:
                raise ConfigError(f"{name} must be above 0 and below 1, got {getattr(self, name)}")


class SiftExtractor:
    """Finds the SIFT keypoints of a photo. Thread-safe.

    Keeps the keypoints of largest scale, as COLMAP does: they repeat across viewing distances,
    while the strongest responses are mostly at the finest scale (TUNING: keep-by-scale).
    """

    name = "opencv-sift"

    def __init__(self, options: SiftOptions | None = None) -> None:
        self._options = options or SiftOptions()

    @property
    def fingerprint(self) -> str:
        """Equal for two extractors only if they find the same features."""
        return f"{self.name}:{self._options}"

    def extract(self, photo: Photo) -> Features:
        """Keypoints in pixels of the file, largest first; none if there is no texture."""
        options = self._options
        gray = cv2.cvtColor(photo.pixels, cv2.COLOR_RGB2GRAY)
        is_large = gray.size >= options.large_photo_px
        # One detector per call: OpenCV does not promise thread safety.
        detector = cv2.SIFT.create(
            nfeatures=options.described_per_kept * options.max_features,
            contrastThreshold=options.contrast_threshold
            if is_large
            else options.small_photo_contrast_threshold,
            enable_precise_upscale=True,
        )
        found, raw = detector.detectAndCompute(gray, None)
        if not found or raw is None:
            return Features(
                np.zeros((0, 4), np.float32),
                np.zeros((0, 128), np.uint8),
                np.zeros((0, 3), np.uint8),
            )
        working = np.array([(*k.pt, k.size, k.angle) for k in found], np.float32)
        response = np.array([k.response for k in found], np.float32)
        kept = _largest(working, response, options.max_features)
        working = working[kept]
        return Features(
            _to_file_pixels(working, photo),
            root_sift(np.asarray(raw, np.float32)[kept]),
            colors_at(photo.pixels, working[:, :2]),
        )


def _largest(working: Float32Array, response: Float32Array, count: int) -> NDArray[np.intp]:
    """Indices of the keypoints at the ``count`` locations of largest scale, then response."""
    order = np.lexsort((-response, -working[:, 2]))
    places = working[order, :3]
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = np.any(places[1:] != places[:-1], axis=1)
    kept: NDArray[np.intp] = order[np.cumsum(is_new) <= count]
    return kept


def root_sift(raw: Float32Array) -> Uint8Array:
    """SIFT (N, 128) float → RootSIFT (N, 128) uint8: L1-normalised, square root, times 512.

    Source: Arandjelovic and Zisserman, "Three things everyone should know to improve object
    retrieval", CVPR 2012; quantised as COLMAP stores descriptors.
    """
    total = np.maximum(raw.sum(axis=1, keepdims=True), 1e-9)
    scaled = np.rint(np.sqrt(raw / total) * DESCRIPTOR_NORM)
    quantised: Uint8Array = np.minimum(scaled, 255).astype(np.uint8)
    return quantised


def _to_file_pixels(working: Float32Array, photo: Photo) -> Float32Array:
    """x, y, diameter, degrees at working size → x, y, scale, radians in pixels of the file.

    OpenCV centres the top-left pixel at (0, 0), COLMAP at (0.5, 0.5).
    """
    scale_x, scale_y = enlarged(photo)
    keypoints = np.empty_like(working)
    keypoints[:, 0] = (working[:, 0] + 0.5) * scale_x
    keypoints[:, 1] = (working[:, 1] + 0.5) * scale_y
    keypoints[:, 2] = working[:, 2] * (0.5 * np.sqrt(scale_x * scale_y))
    keypoints[:, 3] = np.deg2rad(working[:, 3])
    return keypoints


def enlarged(photo: Photo) -> tuple[float, float]:
    """Scale factors in x and y from working pixels to pixels of the file."""
    height, width = photo.pixels.shape[:2]
    return photo.width / width, photo.height / height


def colors_at(pixels: Uint8Array, xy: Float32Array) -> Uint8Array:
    """(N, 3) RGB at (N, 2) places in working pixels, the top-left pixel centred at (0, 0)."""
    height, width = pixels.shape[:2]
    columns = np.clip(np.rint(xy[:, 0]).astype(np.intp), 0, width - 1)
    rows = np.clip(np.rint(xy[:, 1]).astype(np.intp), 0, height - 1)
    return pixels[rows, columns]

"""COLMAP's own SIFT: the faster one if pycolmap was built with CUDA."""

from __future__ import annotations

from threading import Lock

import numpy as np
import pycolmap

from sfm_front.features.sift import SiftOptions, colors_at, enlarged
from sfm_front.types import Features, Float32Array, Photo


class ColmapSift:
    """Finds the SIFT keypoints of a photo. Thread-safe; calls are serialised."""

    name = "colmap-sift"

    def __init__(self, options: SiftOptions | None = None, *, on_gpu: bool = True) -> None:
        """Of ``options`` it takes ``max_features`` alone: number of keypoints, largest scale first.

        COLMAP may return more, since it keeps the last scale level whole.
        """
        options = options or SiftOptions()
        self.fingerprint = f"{self.name}:{options.max_features}"
        """Equal for two extractors only if they find the same features."""
        of_colmap = pycolmap.FeatureExtractionOptions()
        of_colmap.use_gpu = on_gpu
        of_colmap.num_threads = 1
        of_colmap.sift.max_num_features = options.max_features
        device = pycolmap.Device.cuda if on_gpu else pycolmap.Device.cpu
        self._extractor = pycolmap.FeatureExtractor.create(of_colmap, device)
        self._lock = Lock()

    def extract(self, photo: Photo) -> Features:
        """Keypoints in pixels of the file, largest first; none if there is no texture."""
        bitmap = pycolmap.Bitmap.from_array(photo.pixels).clone_as_grey()
        with self._lock:
            found, descriptors = self._extractor.extract(bitmap)
        working = np.array(
            [(k.x, k.y, k.compute_scale(), k.compute_orientation()) for k in found], np.float32
        ).reshape(-1, 4)
        order = np.argsort(-working[:, 2], kind="stable")
        working = working[order]
        return Features(
            _to_file_pixels(working, photo),
            np.asarray(descriptors.data, np.uint8).reshape(-1, 128)[order],
            colors_at(photo.pixels, working[:, :2] - 0.5),
        )


def _to_file_pixels(working: Float32Array, photo: Photo) -> Float32Array:
    scale_x, scale_y = enlarged(photo)
    factors = (scale_x, scale_y, np.sqrt(scale_x * scale_y), 1.0)
    return (working * factors).astype(np.float32)

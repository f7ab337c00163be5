"""A photo's pixels → perceptual hash of 64 bits."""

from __future__ import annotations

import cv2
import numpy as np

from sfm_front.types import Float32Array, Uint8Array

BITS = 64
_SIDE = 32
_LOW_FREQUENCIES = 8


class PerceptualHash:
    """pHash as a global vector: (64,) float32, each bit ±1/8, so that it has length 1.

    The grey photo is reduced to 32 x 32; the 8 x 8 lowest frequencies of its cosine transform are
    kept, and each bit says whether one of them is above their median. The same as OpenCV's pHash,
    whose module is not in its wheel.

    Source: Zauner, "Implementation and Benchmarking of Perceptual Image Hash Functions", 2010.
    """

    name = "phash"
    dimension = BITS
    fingerprint = "phash:dct:32:8"

    def describe(self, pixels: Uint8Array) -> Float32Array:
        """(h, w, 3) uint8 RGB → (64,) float32; cosine is 1 - 2 d / 64 for Hamming distance d."""
        gray = cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY)
        small = cv2.resize(gray, (_SIDE, _SIDE), interpolation=cv2.INTER_AREA)
        spectrum = cv2.dct(small.astype(np.float32))
        low = spectrum[:_LOW_FREQUENCIES, :_LOW_FREQUENCIES].ravel()
        # Without the first, the mean brightness, which would shift the median.
        bits = low > np.median(low[1:])
        unit: Float32Array = np.where(bits, 1, -1).astype(np.float32) / np.float32(BITS**0.5)
        return unit


def packed(vector: Float32Array) -> Uint8Array:
    """The (64,) vector as (8,) uint8, first bit highest."""
    return np.packbits(vector > 0)

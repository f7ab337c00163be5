"""Scale vectors to length 1."""

from __future__ import annotations

import numpy as np

from sfm_front.types import Float32Array

SHORTEST_LENGTH = 1e-9


def unit_length(vectors: Float32Array) -> Float32Array:
    """(..., D) float32 → the same with length 1 along the last axis; vectors of zeros stay."""
    lengths = np.sqrt(np.einsum("...d,...d->...", vectors, vectors))
    unit: Float32Array = vectors / np.maximum(lengths, SHORTEST_LENGTH)[..., np.newaxis]
    return unit

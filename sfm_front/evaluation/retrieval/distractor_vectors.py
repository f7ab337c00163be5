"""Random global vectors, distributed like those of real photos.

A vector is the mean of real ones plus a deviation: runs of numbers from the deviations of random
photos, with random signs. So it resembles no single photo, and every number has the distribution of
real ones. The mean is scaled so that the cosine with a real photo is the usual one of two real
photos, which are unrelated: the full mean of a few scenes is closer to each of them than other
scenes are.
"""

from __future__ import annotations

import numpy as np

from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.types import Float32Array

# The numbers of a VLAD word, which stay together.
_RUN = 64


class VectorMaker:
    """Makes random vectors like (n, d) real ones; all have length 1."""

    def __init__(self, real: Float32Array) -> None:
        mean = real.mean(axis=0)
        self._deviations = real - mean
        usual_cosine = float(np.median((real @ real.T)[np.triu_indices(len(real), 1)]))
        self._common = np.float32(_share(usual_cosine, float(mean @ mean))) * mean

    def make(self, rng: np.random.Generator) -> Float32Array:
        """A random vector, (d,) float32 of length 1."""
        count, dimension = self._deviations.shape
        run_of = np.arange(dimension) // _RUN
        source = rng.integers(count, size=run_of[-1] + 1)
        sign = rng.choice(np.array([-1, 1], np.float32), size=run_of[-1] + 1)
        runs = self._deviations[source[run_of], np.arange(dimension)] * sign[run_of]
        return unit_length(self._common + runs)


def _share(cosine: float, squared_mean: float) -> float:
    """The factor of the mean that gives this average cosine with the real vectors.

    With the factor s and a mean of squared length m, a vector has squared length s² m + 1 - m
    before normalization, and s m is its average product with the real ones.
    """
    target = min(max(cosine, 0.0) ** 2, squared_mean**2)
    if target == 0 or squared_mean >= 1:
        return float(squared_mean >= 1)
    # No factor up to 1 gives a cosine of m or more: then the mean stays whole.
    share = target * (1 - squared_mean) / (squared_mean * (squared_mean - target))
    return float(min(np.sqrt(share), 1.0))

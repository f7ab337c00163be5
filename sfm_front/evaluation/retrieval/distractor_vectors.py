"""Global vectors that no photo has, spread as those of real photos are.

A vector is what real ones have in common, and what they differ by: taken in runs of numbers, each
from another photo at random and with a sign at random. So it resembles no one photo, and every
number is spread as it is in real ones. How much there is of what they have in common is chosen so
that the cosine with a real photo is that of two real ones as they usually are, which is to say
unrelated: the bare mean of a few scenes would be more alike to each of them than another scene is.
"""

from __future__ import annotations

import numpy as np

from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.types import Float32Array

# A VLAD word has about as many numbers: they belong together.
_RUN = 64


class VectorMaker:
    """Makes vectors of length 1 like the (n, d) real ones, of length 1, that it is given."""

    def __init__(self, real: Float32Array) -> None:
        mean = real.mean(axis=0)
        self._deviations = real - mean
        usual_cosine = float(np.median((real @ real.T)[np.triu_indices(len(real), 1)]))
        self._common = np.float32(_share(usual_cosine, float(mean @ mean))) * mean

    def make(self, rng: np.random.Generator) -> Float32Array:
        """Another vector (d,) float32 of length 1."""
        count, dimension = self._deviations.shape
        run_of = np.arange(dimension) // _RUN
        source = rng.integers(count, size=run_of[-1] + 1)
        sign = rng.choice(np.array([-1, 1], np.float32), size=run_of[-1] + 1)
        runs = self._deviations[source[run_of], np.arange(dimension)] * sign[run_of]
        return unit_length(self._common + runs)


def _share(cosine: float, squared_mean: float) -> float:
    """Of the mean, for this cosine with the real vectors on average.

    With a share s of a mean of squared length m, a vector has the squared length s² m + 1 - m
    before it is brought to 1, and s m is its product with the real ones on average.
    """
    target = min(max(cosine, 0.0) ** 2, squared_mean**2)
    if target == 0 or squared_mean >= 1:
        return float(squared_mean >= 1)
    # With a cosine of m and more there is no such share but the whole mean.
    share = target * (1 - squared_mean) / (squared_mean * (squared_mean - target))
    return float(min(np.sqrt(share), 1.0))

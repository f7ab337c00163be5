"""How a cost grows with the number of photos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sfm_front.types import Float64Array


@dataclass(frozen=True, slots=True)
class PowerLaw:
    """``factor`` times the number of photos to the power ``exponent``: what the first so many cost
    together."""

    factor: float
    exponent: float = 1.0

    @classmethod
    def through(
        cls, numbers: Sequence[float] | Float64Array, values: Sequence[float] | Float64Array
    ) -> PowerLaw:
        """By least squares of the logarithms; in proportion where all numbers are the same.

        Nothing that is done for every photo becomes less with more of them: the exponent is not
        below 0.
        """
        logs, log_values = np.log(np.asarray(numbers, float)), np.log(np.asarray(values, float))
        exponent = 1.0
        if np.ptp(logs) > 0:
            exponent = max(0.0, float(np.polyfit(logs, log_values, 1)[0]))
        return cls(float(np.exp(np.mean(log_values - exponent * logs))), exponent)

    def at(self, number: float) -> float:
        """For the first so many photos."""
        return float(self.factor * number**self.exponent) if number > 0 else 0.0

    def between(self, first: float, last: float) -> float:
        """For the photos from ``first`` on to ``last``."""
        return self.at(last) - self.at(first)

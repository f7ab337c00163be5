"""Measured positions of a model's photos, as the alignment reads them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sfm_front.types import Float64Array

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """N positions in the order in which the photos were taken: neighbours share their errors.

    ``enu`` (N, 3): metres east, north and up; 0 in place of a height that is not known.
    ``sigmas`` (N, 3): standard deviations in metres, the same east and north, inf of a height that
    is not known.
    ``flights`` (N,): photos of one number share what their heights are measured from.
    """

    enu: Float64Array
    sigmas: Float64Array
    flights: IntArray

    @classmethod
    def of(cls, enu: Float64Array, sigmas: Float64Array, flights: IntArray | None = None) -> Fixes:
        """``enu``: nan in place of a height that is not known. One flight unless told."""
        known = np.isfinite(enu)
        return cls(
            np.where(known, enu, 0.0),
            np.where(known, sigmas, np.inf),
            np.zeros(len(enu), np.int64) if flights is None else flights,
        )

    def __len__(self) -> int:
        return len(self.enu)

    def __getitem__(self, chosen: IntArray | BoolArray) -> Fixes:
        return Fixes(self.enu[chosen], self.sigmas[chosen], self.flights[chosen])

    @property
    def known(self) -> BoolArray:
        """(N, 3) False for heights that are not known."""
        return np.isfinite(self.sigmas)

    def raised(self, offsets: dict[int, float]) -> Fixes:
        """Heights of each flight less its offset in metres."""
        heights = np.array([offsets.get(int(flight), 0.0) for flight in self.flights])
        shift = np.column_stack([np.zeros((len(self), 2)), heights])
        return Fixes(np.where(self.known, self.enu - shift, 0.0), self.sigmas, self.flights)

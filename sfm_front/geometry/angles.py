"""Angles that are the same after a whole turn."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FULL_TURN = 2 * np.pi


def wrapped(angles_rad: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """(N,) the same angles, from -pi up to pi."""
    within: NDArray[np.floating[Any]] = np.mod(angles_rad + np.pi, FULL_TURN) - np.pi
    return within

"""A photo as a grid of square cells, to compare where things lie in it."""

from __future__ import annotations

import numpy as np
import pycolmap

from sfm_front.mapping.covisibility import BoolArray, IndexArray
from sfm_front.types import Float64Array

CELLS = 24
"""Cells along the long side of a photo."""

# One more on each side, for what lies outside.
_GRID = (CELLS + 2, CELLS + 2)


def cells_of(pixels: Float64Array, camera: pycolmap.Camera) -> IndexArray:
    """(N,) numbers of the cells that pixels (N, 2) lie in; 0 for those outside, or nan."""
    x, y = pixels.T
    inside: BoolArray = (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
    size = max(camera.width, camera.height) / CELLS
    column, row = ((np.where(inside, z, 0) / size).astype(np.int64) + 1 for z in (x, y))
    return np.where(inside, row * _GRID[1] + column, 0)


def occupied(cells: IndexArray) -> BoolArray:
    """The grid, True at these cells (N,)."""
    grid = np.zeros(_GRID, np.bool_)
    grid.ravel()[cells] = True
    grid[0, 0] = False
    return grid


def widened(cells: BoolArray) -> BoolArray:
    """The cells of a grid and all that touch them."""
    wide: BoolArray = cells.copy()
    wide[1:] |= cells[:-1]
    wide[:-1] |= cells[1:]
    rows = wide.copy()
    wide[:, 1:] |= rows[:, :-1]
    wide[:, :-1] |= rows[:, 1:]
    return wide

"""Which features of two photos are compared with each other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class MaskBlock(NamedTuple):
    """Rows of the first order against columns of the second.

    ``allowed`` (rows, columns): which of these pairs are compared; None if all are.
    """

    rows: slice
    columns: slice | NDArray[np.intp]
    allowed: NDArray[np.bool_] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MatchMask:
    """Features ordered so that those to be compared form blocks.

    ``order1`` (N,): indices of features of the first photo, each at most once. ``order2`` (M',):
    of the second, where some may occur twice, but not in one block. ``blocks`` can be iterated
    only once.
    """

    order1: NDArray[np.intp]
    order2: NDArray[np.intp]
    blocks: Iterable[MaskBlock]

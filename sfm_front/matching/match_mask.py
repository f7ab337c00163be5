"""Which features of two photos are compared with each other."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class MaskBlock(NamedTuple):
    """Rows of the first order against columns of the second; ``meet`` (rows, columns): which of
    these do, None where all do."""

    rows: slice
    columns: slice | NDArray[np.intp]
    allowed: NDArray[np.bool_] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MatchMask:
    """Features in such an order that those to be compared lie in blocks.

    ``order1`` (N,): indices of features of the first photo, each at most once. ``order2`` (M',):
    of the second, where some may come twice. ``blocks`` may be gone through once.
    """

    order1: NDArray[np.intp]
    order2: NDArray[np.intp]
    blocks: Iterable[MaskBlock]

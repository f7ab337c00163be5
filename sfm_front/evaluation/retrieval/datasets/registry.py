"""Published datasets by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from sfm_front.evaluation.retrieval.datasets import holidays, oxford, revisited
from sfm_front.evaluation.retrieval.types import Dataset

PUBLISHED: Mapping[str, Callable[[Path], tuple[Dataset, ...]]] = MappingProxyType(
    {
        "holidays": holidays.load,
        "oxford5k": oxford.load_oxford5k,
        "paris6k": oxford.load_paris6k,
        "roxford5k": revisited.load_roxford5k,
        "rparis6k": revisited.load_rparis6k,
    }
)
"""The reader of each from a folder: one dataset, or several over the same photos."""

"""All options of a session in one place; each part is checked when it is built."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path

from sfm_front.errors import ConfigError
from sfm_front.features.sift import SiftExtractor
from sfm_front.mapping.atlas import AtlasOptions
from sfm_front.matching.guided_matching import GuidedOptions
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.matching.verification import VerificationOptions
from sfm_front.photos.cameras import CameraOptions
from sfm_front.photos.reader import PhotoReader
from sfm_front.retrieval.rerank import RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.session.pair_matching import PairMatchingOptions


def available_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_LARGEST_CACHE = 2 * 2**30


def _default_cache_bytes() -> int:
    """A quarter of the machine's memory, 2 GiB at most, and where it is not known."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):  # Windows has no sysconf
        return _LARGEST_CACHE
    return min(memory // 4, _LARGEST_CACHE)


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """How photos are described, retrieved, matched and mapped.

    ``max_image_size``: long side in pixels that photos are reduced to. ``max_features``: SIFT
    keypoints a photo. ``global_descriptor``: a name that ``features.global_descriptor.resolve``
    knows; ``weights``: a file for its network; ``device``: ``auto``, ``cpu`` or
    ``cuda``, of the network and of matching. ``rerank``: the look that ranks candidates;
    ``second_rerank``: at those of which it told too little.
    ``pair_matching``: the candidates that are matched on all features.
    ``threads``: cores to use. ``seed``: of all RANSAC. Both reach every part from here.
    ``text``: write models in COLMAP's text form too. ``snapshot_seconds``: how old the models in
    ``sparse/`` may be while photos arrive; ``cache_mb``: memory for features of earlier photos,
    None: a quarter of the machine's, 2 GiB at most; others are read again from the database.
    """

    max_image_size: int = 1600
    max_features: int = 4000
    global_descriptor: str = "auto"
    weights: Path | None = None
    device: str = "auto"
    text: bool = False
    snapshot_seconds: float = 30.0
    cache_mb: int | None = None
    threads: int = field(default_factory=available_cores)
    seed: int = 0
    cameras: CameraOptions = field(default_factory=CameraOptions)
    retrieval: RetrievalOptions = field(default_factory=RetrievalOptions)
    rerank: RerankOptions = field(default_factory=RerankOptions)
    second_rerank: RerankOptions = field(default_factory=lambda: RerankOptions(max_features=2000))
    pair_matching: PairMatchingOptions = field(default_factory=PairMatchingOptions)
    matching: MatchingOptions = field(default_factory=MatchingOptions)
    guided: GuidedOptions = field(default_factory=GuidedOptions)
    verification: VerificationOptions = field(default_factory=VerificationOptions)
    atlas: AtlasOptions = field(default_factory=AtlasOptions)

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise ConfigError(f"threads must be at least 1, got {self.threads}")
        if self.snapshot_seconds <= 0:
            raise ConfigError(f"snapshot_seconds must be above 0, got {self.snapshot_seconds}")
        if self.cache_mb is not None and self.cache_mb < 1:
            raise ConfigError(f"cache_mb must be at least 1, got {self.cache_mb}")
        mapper = replace(self.atlas.mapper, num_threads=self.threads, seed=self.seed)
        localization = replace(self.atlas.localization, seed=self.seed)
        atlas = replace(self.atlas, mapper=mapper, localization=localization)
        object.__setattr__(self, "atlas", atlas)
        object.__setattr__(self, "verification", replace(self.verification, seed=self.seed))
        # These check themselves: here, so that it is done before a session has written anything.
        PhotoReader(max_image_size=self.max_image_size)
        SiftExtractor(self.max_features)

    @property
    def cache_bytes(self) -> int:
        """Memory for features of earlier photos."""
        return _default_cache_bytes() if self.cache_mb is None else self.cache_mb * 2**20

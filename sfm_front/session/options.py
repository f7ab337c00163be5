"""All options of a session in one place; each part is checked when it is built."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from pathlib import Path

from sfm_front.errors import ConfigError
from sfm_front.features.global_descriptors.descriptor import AUTO, VLAD_WEIGHT, check_vlad_weight
from sfm_front.features.sift import SiftOptions
from sfm_front.georeference.control.options import ControlOptions
from sfm_front.mapping.atlas import AtlasOptions
from sfm_front.matching.guided_matching import GuidedOptions
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.matching.verification import VerificationOptions
from sfm_front.photos.cameras import CameraOptions
from sfm_front.photos.positions import OFF, PositionOptions
from sfm_front.photos.reader import PhotoReader
from sfm_front.retrieval.rerank import RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.session.pair_matching import PairMatchingOptions
from sfm_front.session.second_look import SecondLookOptions


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

    ``max_features``, ``threads`` and ``seed`` reach every part from here, as does whether cameras
    grow: what a part is given for them is replaced.
    """

    # Long side that photos are reduced to, in pixels.
    max_image_size: int = 1600
    # SIFT keypoints per photo.
    max_features: int = SiftOptions.max_features
    # A name that ``global_descriptors.descriptor.resolve`` knows.
    global_descriptor: str = AUTO
    # A file for its network, instead of the official one.
    weights: Path | None = None
    # Weight of VLAD's cosine if it is joined with one network (TUNING: vlad-weight).
    vlad_weight: float = VLAD_WEIGHT
    # Of the network and of matching: auto, cpu or cuda.
    device: str = "auto"
    # Whether to write models in COLMAP's text form too.
    text: bool = False
    # How old the models in ``sparse/`` may be while photos arrive.
    snapshot_seconds: float = 30.0
    # Memory for features of earlier photos, in MiB; others are read again from the database.
    # None: a quarter of the machine's, 2 GiB at most.
    cache_mb: int | None = None
    # Cores to use.
    threads: int = field(default_factory=available_cores)
    # Of all RANSAC.
    seed: int = 0
    # Which photos share a camera.
    cameras: CameraOptions = field(default_factory=CameraOptions)
    # Where photos were taken, and how exactly that is known.
    positions: PositionOptions = field(default_factory=PositionOptions)
    # Surveyed points with marks in photos, to which a model is held at the end.
    control_points: ControlOptions = field(default_factory=ControlOptions)
    # Whether models are moved to where positions say they stand: auto, as soon as these fix it, or
    # off.
    georegister: str = AUTO
    # Which keypoints are found and kept. COLMAP's SIFT, on CUDA, takes max_features alone.
    sift: SiftOptions = field(default_factory=SiftOptions)
    # Which candidates the global vectors propose.
    retrieval: RetrievalOptions = field(default_factory=RetrievalOptions)
    # How the candidates are ranked.
    rerank: RerankOptions = field(default_factory=RerankOptions)
    # How those without a known in-plane rotation are ranked a second time.
    second_rerank: RerankOptions = field(default_factory=lambda: RerankOptions(max_features=2000))
    # Which candidates are matched on all features.
    pair_matching: PairMatchingOptions = field(default_factory=PairMatchingOptions)
    # Which features of two photos match.
    matching: MatchingOptions = field(default_factory=MatchingOptions)
    # The same if the poses of both photos are known.
    guided: GuidedOptions = field(default_factory=GuidedOptions)
    # Which pairs of photos are accepted.
    verification: VerificationOptions = field(default_factory=VerificationOptions)
    # Which photos are matched once more, with more candidates, and how much that may cost.
    second_look: SecondLookOptions = field(default_factory=SecondLookOptions)
    # How the models grow.
    atlas: AtlasOptions = field(default_factory=AtlasOptions)

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise ConfigError(f"threads must be at least 1, got {self.threads}")
        if self.georegister not in (AUTO, OFF):
            raise ConfigError(f"georegister must be {AUTO} or {OFF}, got {self.georegister!r}")
        if self.georegister == OFF and self.control_points.file is not None:
            raise ConfigError("control points move a model: leave georegister = off out, or them")
        if self.snapshot_seconds <= 0:
            raise ConfigError(f"snapshot_seconds must be above 0, got {self.snapshot_seconds}")
        if self.cache_mb is not None and self.cache_mb < 1:
            raise ConfigError(f"cache_mb must be at least 1, got {self.cache_mb}")
        mapper = self.atlas.mapper
        calibration = replace(mapper.calibration, grow_lens=self.cameras.may_grow)
        mapper = replace(mapper, num_threads=self.threads, seed=self.seed, calibration=calibration)
        localization = replace(self.atlas.localization, seed=self.seed)
        atlas = replace(self.atlas, mapper=mapper, localization=localization)
        object.__setattr__(self, "atlas", atlas)
        object.__setattr__(self, "verification", replace(self.verification, seed=self.seed))
        object.__setattr__(self, "sift", replace(self.sift, max_features=self.max_features))
        # Checked here, so that it is done before a session has written anything.
        check_vlad_weight(self.vlad_weight)
        PhotoReader(max_image_size=self.max_image_size)

    @property
    def cache_bytes(self) -> int:
        """Memory for features of earlier photos."""
        return _default_cache_bytes() if self.cache_mb is None else self.cache_mb * 2**20

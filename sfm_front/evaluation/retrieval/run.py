"""The whole retrieval benchmark: datasets and methods by name → outcomes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from sfm_front.errors import ConfigError
from sfm_front.evaluation.retrieval import specs
from sfm_front.evaluation.retrieval.benchmark import Outcome, benchmark
from sfm_front.evaluation.retrieval.datasets.pool import MIN_SHARED_POINTS
from sfm_front.evaluation.retrieval.describe import BenchExtraction
from sfm_front.evaluation.retrieval.distractors import WithDistractors
from sfm_front.evaluation.retrieval.figures.writing import FigureWriter
from sfm_front.evaluation.retrieval.material import Material, describe, sampled
from sfm_front.evaluation.retrieval.methods import make_method
from sfm_front.evaluation.retrieval.methods.by_vector import ByVector
from sfm_front.evaluation.retrieval.methods.hierarchical import Hierarchical
from sfm_front.evaluation.retrieval.types import Method
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor, resolve
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.retrieval.rerank import RerankOptions
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.runtime.worker_pool import WorkerPool

OURS = Hierarchical.name
"""Our method; ``ours:VECTOR`` is ours with another global vector."""

Note = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class RetrievalSettings:
    """Datasets, methods, and the settings all methods share.

    ``datasets`` as ``specs`` reads them; ``models`` and ``min_shared`` are for pools among them.
    ``methods``: names in ``METHODS``, ``ours:VECTOR`` for ours with another global vector, or
    global vectors joined by ``+``. ``weights``: files by network name; other networks' are looked
    up in torch's cache. ``cache``: the folder of described photos. ``scale``: indices are filled
    with distractors up to this many photos. ``num_queries`` per dataset, all if None. ``retrieval``
    and ``rerank`` are for our method.
    """

    datasets: Sequence[str]
    methods: Sequence[str]
    threads: int
    cache: Path
    models: Path | None = None
    min_shared: int = MIN_SHARED_POINTS
    weights: Mapping[str, Path] = field(default_factory=dict)
    max_image_size_px: int = 1600
    max_features: int = 4000
    scale: int | None = None
    num_queries: int | None = None
    retrieval: RetrievalOptions = field(default_factory=RetrievalOptions)
    rerank: RerankOptions = field(default_factory=RerankOptions)

    def __post_init__(self) -> None:
        if not self.methods or len(set(self.methods)) < len(self.methods):
            raise ConfigError(f"name at least one method, each once; got {','.join(self.methods)}")
        for name in ("threads", "min_shared", "scale", "num_queries"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ConfigError(f"{name} must be at least 1, got {value}")


def run(
    settings: RetrievalSettings, note: Note, figures: FigureWriter | None = None
) -> list[Outcome]:
    """Every method on every dataset; ``note`` is called with a line about each step.

    Errors in settings or folders are raised before the first photo is described.
    """
    outcomes: list[Outcome] = []
    with WorkerPool(settings.threads) as workers:
        methods = [_method(name, workers, settings) for name in settings.methods]
        vectors = dict.fromkeys(name for method in methods for name in method.global_vectors)
        describer = BenchExtraction(
            settings.cache,
            descriptors(vectors, settings.weights),
            max_image_size=settings.max_image_size_px,
            max_features=settings.max_features,
            num_threads=settings.threads,
        )
        loaded = [
            specs.load(
                spec,
                models=settings.models,
                min_shared=settings.min_shared,
                threads=settings.threads,
                note=note,
            )
            for spec in settings.datasets
        ]
        for datasets in loaded:
            asked = [
                replace(dataset, queries=sampled(dataset.queries, settings.num_queries))
                for dataset in datasets
            ]
            material = describe(asked, describer, note)
            filled = _filled(material, settings)
            for method in methods:
                outcomes += benchmark(method, filled, note)
                if figures is not None:
                    figures.results(method, filled)
            if figures is not None:
                figures.vectors(list(vectors), material)
                figures.first_layers(settings.weights, material)
    return outcomes


def descriptors(names: Iterable[str], weights: Mapping[str, Path]) -> dict[str, GlobalDescriptor]:
    """Global descriptors by name, each network with its file in ``weights``, if any."""
    resolved = {}
    for name in names:
        own = next((weights[part] for part in name.split("+") if part in weights), None)
        resolved[name], _ = resolve(name, weights=own)
    return resolved


def _method(name: str, workers: WorkerPool, settings: RetrievalSettings) -> Method:
    ours, _, vector = name.partition(":")
    if ours == OURS:
        return Hierarchical(
            workers,
            vector=vector or Vlad.name,
            retrieval=settings.retrieval,
            rerank=settings.rerank,
        )
    return ByVector(name) if "+" in name else make_method(name, workers)


def _filled(material: Material, settings: RetrievalSettings) -> Material:
    if settings.scale is None:
        return material
    filled = WithDistractors(material.photos, settings.scale, settings.max_features)
    return replace(material, photos=filled)

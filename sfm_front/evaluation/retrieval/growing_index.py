"""The index of a long flight as it grows: seconds of a query, and recall of exact search."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np

from sfm_front.errors import ConfigError
from sfm_front.evaluation.process import resident_bytes
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor, resolve
from sfm_front.retrieval.index import CosineIndex
from sfm_front.retrieval.retriever import RetrievalOptions
from sfm_front.types import Float32Array

_DESCRIPTOR = "vlad"


@dataclass(frozen=True, slots=True)
class IndexCost:
    """A query among ``num_photos`` vectors, in wall seconds and, which other work on the machine
    hardly affects, in CPU seconds of all threads. ``recall``: the share of the candidates that
    exact search finds, too. ``memory_bytes``: that the process holds; None on systems without
    /proc."""

    num_photos: int
    median_seconds: float
    worst_seconds: float
    processor_seconds: float
    recall: float
    memory_bytes: int | None


def measure_index(
    sizes: Sequence[int],
    num_queries: int,
    points_per_image: int,
    *,
    seed: int = 0,
    options: RetrievalOptions | None = None,
    note: Callable[[IndexCost], None] = lambda _: None,
) -> list[IndexCost]:
    """Add the photos of one flight in the order in which they are taken, and ask at each of these
    sizes for the candidates of the ``num_queries`` photos that come next.

    They are timed as a session asks, with the query expanded; recall is that of the cosines alone,
    so that exact search has one answer. Raises ConfigError for a size or number below 1.
    """
    sizes, options = sorted(set(sizes)), options or RetrievalOptions()
    if not sizes or min(*sizes, num_queries) < 1:
        raise ConfigError("sizes of an index and its queries must be at least 1")
    scene = make_scene(sizes[-1] + num_queries, points_per_image, seed=seed, layout="strip")
    descriptor, _ = resolve(_DESCRIPTOR)
    index = CosineIndex(descriptor.dimension, options.index)
    queries = {
        size: np.stack([_vector(scene, descriptor, size + n) for n in range(num_queries)])
        for size in sizes
    }
    every = np.concatenate(list(queries.values()))
    # Rather than all vectors, which would not fit, their cosines are kept.
    exact = np.empty((sizes[-1], len(every)), np.float32)
    costs = []
    for number in range(sizes[-1]):
        vector = _vector(scene, descriptor, number)
        index.add(number, vector)
        exact[number] = every @ vector
        size = number + 1
        if size in queries:
            start = sizes.index(size) * num_queries
            cosines = exact[:size, start : start + num_queries].T
            costs.append(_asked(index, queries[size], cosines, options))
            note(costs[-1])
    return costs


def _vector(scene: SyntheticScene, descriptor: GlobalDescriptor, number: int) -> Float32Array:
    return descriptor.describe(np.empty(0, np.uint8), scene.photo(number).features)


def _asked(
    index: CosineIndex, queries: Float32Array, exact: Float32Array, options: RetrievalOptions
) -> IndexCost:
    """``queries`` (Q, D), ``exact`` (Q, N) their cosines with all that is in the index."""
    count, seconds, processor, found = min(options.candidates, len(index)), [], [], 0
    for query, cosines in zip(queries, exact, strict=True):
        started, processor_started = perf_counter(), process_time()
        index.query(query, count, num_expansion=options.num_expansion)
        seconds.append(perf_counter() - started)
        processor.append(process_time() - processor_started)
        right = set(np.argsort(-cosines, kind="stable")[:count].tolist())
        found += len(right & {candidate.image_id for candidate in index.query(query, count)})
    return IndexCost(
        len(index),
        float(np.median(seconds)),
        max(seconds),
        float(np.median(processor)),
        found / (count * len(queries)),
        resident_bytes(),
    )

"""Datasets → the input of all methods: described photos to index, and described queries."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from random import Random

from sfm_front.errors import InputError
from sfm_front.evaluation.retrieval.describe import BenchExtraction, Described
from sfm_front.evaluation.retrieval.types import BenchPhoto, Dataset, Query

QueryKey = tuple[str, tuple[float, float, float, float] | None]
"""A query's photo and box: all that a method sees of it."""

_TOLD_EVERY = 100
_SEED = 0


@dataclass(frozen=True, slots=True, eq=False)
class Material:
    """Datasets over the same photos, and these photos described.

    ``photos``: those to index. ``names`` by image id; distractors have none. ``queries`` by photo
    and box, without those that cannot be described.
    """

    datasets: Sequence[Dataset]
    photos: Sequence[BenchPhoto]
    names: Mapping[int, str]
    queries: Mapping[QueryKey, BenchPhoto]


def key_of(query: Query) -> QueryKey:
    """Queries of the same key are the same to a method."""
    return query.photo, query.box


def sampled(queries: tuple[Query, ...], count: int | None) -> tuple[Query, ...]:
    """``count`` random queries, always the same ones and in their order; all if ``count`` is None
    or there are fewer."""
    if count is None or count >= len(queries):
        return queries
    chosen = sorted(Random(_SEED).sample(range(len(queries)), count))
    return tuple(queries[i] for i in chosen)


def describe(
    datasets: Sequence[Dataset], describer: BenchExtraction, note: Callable[[str], None]
) -> Material:
    """Describe the photos and queries of ``datasets``, which all search the same photos.

    A query that is a whole indexed photo is not described again. ``note`` is called with progress
    and with every photo that cannot be used. Raises ``InputError`` if none can.
    """
    first = datasets[0]

    def progress(done: int, whole: int) -> None:
        if done % _TOLD_EVERY == 0 or done == whole:
            note(f"{first.name}: {done} of {whole} photos described")

    described = describer.photos(first.photos, progress)
    _tell(described, note)
    if not described.photos:
        raise InputError(f"{first.name}: none of its {len(first.photos)} photos can be used")
    asked = {key_of(query): query for dataset in datasets for query in dataset.queries}
    indexed = {
        key: described.photos[query.photo]
        for key, query in asked.items()
        if query.box is None and query.photo in described.photos
    }
    others = [query for key, query in asked.items() if key not in indexed]
    apart = describer.queries(others, {**first.photos, **first.query_photos})
    _tell(apart, note)
    by_name = {query.name: key_of(query) for query in others}
    queries = indexed | {by_name[name]: photo for name, photo in apart.photos.items()}
    for dataset in datasets:
        if not any(key_of(query) in queries for query in dataset.queries):
            raise InputError(f"{dataset.name}: none of its queries can be used")
    return Material(
        datasets=datasets,
        photos=list(described.photos.values()),
        names={photo.view.image_id: name for name, photo in described.photos.items()},
        queries=queries,
    )


def _tell(described: Described, note: Callable[[str], None]) -> None:
    for skipped in described.skipped:
        note(f"{skipped.name}: {skipped}")

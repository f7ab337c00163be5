"""What retrieval datasets, methods and the benchmark exchange."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, runtime_checkable

from sfm_front.types import Float32Array, Uint8Array, View


@dataclass(frozen=True, slots=True)
class Query:
    """A photo to search with, and what should be found.

    ``photo``, ``relevant`` and ``ignored`` are names in the dataset. ``box``: left, top, right,
    bottom in pixels of the file, if only that part of the photo is the query. ``ignored`` photos
    ("junk") count neither for nor against a ranking; the query itself is among them if the
    dataset's protocol excludes it.
    """

    name: str
    photo: str
    relevant: frozenset[str]
    ignored: frozenset[str] = frozenset()
    box: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Dataset:
    """Photos to search, by name, and queries with their answers.

    ``query_photos`` are queries that are not searched themselves; their names are not in
    ``photos``.
    """

    name: str
    photos: Mapping[str, Path]
    queries: tuple[Query, ...]
    query_photos: Mapping[str, Path] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class BenchPhoto:
    """A photo with everything that any method needs.

    ``view`` has image id, camera and SIFT features. ``vectors``: (d,) float32 of length 1, by the
    name of the global descriptor. ``perceptual_hash``: (8,) uint8, 64 bits.
    """

    view: View
    vectors: Mapping[str, Float32Array]
    perceptual_hash: Uint8Array


@dataclass(frozen=True, slots=True)
class Ranked:
    """A photo in an answer: higher ``score`` is better; its meaning depends on the method.

    ``cosine`` and ``inliers`` if the method computes them.
    """

    image_id: int
    score: float
    cosine: float | None = None
    inliers: int | None = None


class Method(Protocol):
    """One way to search photos by photo. Build once, then query any number of times."""

    @property
    def name(self) -> str: ...

    @property
    def global_vectors(self) -> tuple[str, ...]:
        """The global descriptors it needs in ``BenchPhoto.vectors``."""
        ...

    def build(self, photos: Sequence[BenchPhoto]) -> None:
        """Index these photos."""
        ...

    def rank(self, query: BenchPhoto) -> list[Ranked]:
        """All indexed photos, best first; the query's own too, if it is indexed."""
        ...


@runtime_checkable
class Staged(Protocol):
    """A method that times its stages."""

    @property
    def seconds(self) -> Mapping[str, float]:
        """Of the last query, by stage; work that only completes the ranking does not count."""
        ...

"""What coordinator and workers hand each other; all of it is pickled into ``bytes`` once."""

from __future__ import annotations

import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pycolmap

from sfm_front.features.feature_cache import CachedFeatures
from sfm_front.mapping.model_state import ModelState
from sfm_front.session.options import SessionOptions
from sfm_front.types import (
    Candidate,
    Features,
    Float32Array,
    PairGeometry,
    RankedCandidate,
    Rejected,
    Skipped,
)

DESCRIBE, MATCH, GROW, JOIN = "describe", "match", "grow", "join"


@dataclass(frozen=True, slots=True)
class RunSettings:
    """The same for all tasks of a run.

    ``descriptor``: fingerprint of its global descriptor;
    ``cache``: the folder of features if workers see it too, else None.
    """

    run_id: str
    options: SessionOptions
    descriptor: str
    cache: Path | None


@dataclass(frozen=True, slots=True)
class PhotoFile:
    """A photo to describe, and its bytes where the worker does not see the file."""

    name: str
    path: Path
    content: bytes | None = None


@dataclass(frozen=True, slots=True, eq=False)
class DescribedPhoto:
    """``local`` and ``vector`` are None where they lie in the shared cache. ``reused``: they lay
    there already."""

    name: str
    digest: str
    seconds: Mapping[str, float]
    reused: bool
    local: CachedFeatures | None = None
    vector: Float32Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Query:
    """A photo to match, with the candidates that its global vector found."""

    image_id: int
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MatchWork:
    """Queries, and what is needed of all photos in them, by image id.

    ``keys``: of the features in the cache; ``sent``: the features, where it is not shared.
    """

    queries: tuple[Query, ...]
    cameras: Mapping[int, pycolmap.Camera]
    keys: Mapping[int, str]
    sent: Mapping[int, Features]


@dataclass(frozen=True, slots=True, eq=False)
class MatchedPhoto:
    """``ranked`` come without their matches. ``rejected``: by image id."""

    image_id: int
    ranked: tuple[RankedCandidate, ...]
    pairs: tuple[PairGeometry, ...]
    rejected: Mapping[int, Rejected]
    seconds: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class GroupPhoto:
    """``points`` (N, 2) float32: pixels of the file."""

    image_id: int
    name: str
    camera_id: int
    points: Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class GroupWork:
    """A group of photos in order of arrival, and the verified pairs among them by later photo."""

    photos: tuple[GroupPhoto, ...]
    cameras: Mapping[int, pycolmap.Camera]
    pairs: Mapping[int, tuple[PairGeometry, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class GrownModel:
    """A model as COLMAP's binary ``files`` by name; pycolmap cannot pickle it."""

    files: Mapping[str, bytes]
    state: ModelState
    num_registered: int


@dataclass(frozen=True, slots=True, eq=False)
class JoinWork:
    """Two groups as one, and the models that were grown of them."""

    group: GroupWork
    models: tuple[GrownModel, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """What a worker gives back: the pickled result, and what it took.

    ``bytes_in`` and ``bytes_out`` count messages and the shared files read and written.
    """

    result: bytes
    worker: str
    seconds: float
    cpu_seconds: float
    items: int
    reused: int
    bytes_in: int
    bytes_out: int


def pack(value: Any) -> bytes:
    """For the way; ``unpack`` only what came from this run's own processes."""
    return pickle.dumps(value, protocol=pickle.HIGHEST_PROTOCOL)


def unpack(parcel: bytes) -> Any:
    """What was packed."""
    return pickle.loads(parcel)


Described = DescribedPhoto | Skipped

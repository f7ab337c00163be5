"""A scene pool: folders of photos, with COLMAP models that say which photos share points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import InputError
from sfm_front.evaluation.retrieval.types import Dataset, Query
from sfm_front.photos.source import list_photos
from sfm_front.storage.colmap_models import find_models, read_model

if TYPE_CHECKING:
    import pycolmap

#: Two photos that share at least this many points are relevant to each other.
MIN_SHARED_POINTS = 20

# Points per step, so that a large model needs little memory.
_BLOCK = 20_000


@dataclass(frozen=True, slots=True)
class Scene:
    """A scene: all photos below the folder ``photos``, and the folders of its reference models."""

    name: str
    photos: Path
    models: tuple[Path, ...]


def find_scenes(folder: Path) -> tuple[Scene, ...]:
    """The scenes of a pool: sub-folders that have an ``images`` folder, or ``folder`` itself.

    Models are those in a scene's ``sparse``. Raises ``InputError`` if there is no scene.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; give a folder of scenes, each with images/")
    homes = [folder] if (folder / "images").is_dir() else sorted(folder.iterdir())
    scenes = tuple(
        Scene(home.resolve().name, home / "images", tuple(find_models(home / "sparse")))
        for home in homes
        if (home / "images").is_dir()
    )
    if not scenes:
        raise InputError(f"{folder}: no scene in it; a scene is a folder with images/ in it")
    return scenes


def load(scenes: Sequence[Scene], name: str, min_shared: int = MIN_SHARED_POINTS) -> Dataset:
    """One dataset of all photos of all scenes, named ``scene/photo``.

    Two photos are relevant to each other if they share ``min_shared`` points in any reference
    model; photos of different scenes never are. Every photo with a relevant one is a query, and
    ignored in its own ranking.
    """
    photos: dict[str, Path] = {}
    queries: list[Query] = []
    for scene in scenes:
        listed = {f"{scene.name}/{photo.name}": photo.path for photo in list_photos(scene.photos)}
        related = related_photos(map(read_model, scene.models), min_shared)
        for name_in_pool in listed:
            others = related.get(name_in_pool.removeprefix(f"{scene.name}/"), ())
            relevant = frozenset(f"{scene.name}/{other}" for other in others) & listed.keys()
            if relevant:
                own = frozenset([name_in_pool])
                queries.append(Query(name_in_pool, name_in_pool, relevant, own))
        photos.update(listed)
    if not queries:
        raise InputError(
            f"{name}: no two photos share {min_shared} points in a reference model; "
            "is the model that of these photos?"
        )
    return Dataset(name, photos, tuple(queries))


def related_photos(
    models: Iterable[pycolmap.Reconstruction], min_shared: int
) -> Mapping[str, frozenset[str]]:
    """By photo, the others with which it shares ``min_shared`` points in one of the models."""
    related: dict[str, set[str]] = {}
    for model in models:
        names, shared = shared_points(model)
        for row, name in enumerate(names):
            others = np.flatnonzero(shared[row] >= min_shared)
            related.setdefault(name, set()).update(names[i] for i in others if i != row)
    return {name: frozenset(others) for name, others in related.items()}


def shared_points(model: pycolmap.Reconstruction) -> tuple[list[str], NDArray[np.int64]]:
    """Names of the n registered photos, and the number of points each pair shares, (n, n)."""
    images = [model.images[image_id] for image_id in model.reg_image_ids()]
    row_of = {point_id: row for row, point_id in enumerate(model.point3D_ids())}
    seen_by = [
        np.unique([row_of[p.point3D_id] for p in image.points2D if p.has_point3D()])
        for image in images
    ]
    shared = np.zeros((len(images), len(images)), np.int64)
    for start in range(0, len(row_of), _BLOCK):
        sees = np.zeros((len(images), _BLOCK), np.float32)
        for sees_of_image, rows in zip(sees, seen_by, strict=True):
            inside = rows[(rows >= start) & (rows < start + _BLOCK)]
            sees_of_image[inside.astype(np.intp) - start] = 1
        shared += (sees @ sees.T).astype(np.int64)
    return [image.name for image in images], shared

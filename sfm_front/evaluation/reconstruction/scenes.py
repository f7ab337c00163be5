"""A folder to benchmark on → its photos and their ground truth."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.photos.source import list_photos
from sfm_front.storage.colmap_models import find_models, is_model, read_model

NamePair = tuple[str, str]

_NUMBERS = re.compile(r"[_\d]*\.\w+$")


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkScene:
    """``truth`` is the folder of a COLMAP model with the true poses. ``pairs`` are the overlapping
    pairs, by name; if given, poses are assessed on these pairs only. ``landmarks``, if there are
    several: which one a photo shows, by its name in lower case."""

    name: str
    photos: Path
    num_photos: int
    truth: Path | None = None
    pairs: tuple[NamePair, ...] | None = None
    landmarks: Mapping[str, str] | None = None


def find_scene(folder: Path, truth: Path | None = None) -> BenchmarkScene:
    """The scene in ``folder``: a folder of photos, or one that has them in its ``images``.

    Ground truth is ``truth``, else looked for in ``gt`` beside or in the folder of photos: a model,
    and a list of overlapping pairs, ``*pairs*.txt`` with two names per line. Raises ``InputError``
    if there are no photos or ``truth`` is not a model.
    """
    photos = folder / "images" if (folder / "images").is_dir() else folder
    num_photos = len(list_photos(photos))
    home = photos.resolve().parent if photos.resolve().name == "images" else photos.resolve()
    if truth is not None:
        if not is_model(truth):
            below = find_models(truth)
            hint = f"try {below[0]}" if below else "expected cameras, images and points3D"
            raise InputError(f"{truth}: no COLMAP model in it; {hint}")
        return BenchmarkScene(name=home.name, photos=photos, num_photos=num_photos, truth=truth)
    for found in (photos.resolve().parent / "gt", photos.resolve() / "gt"):
        lists = sorted(found.glob("*pairs*.txt"))
        if is_model(found) or lists:
            return BenchmarkScene(
                name=home.name,
                photos=photos,
                num_photos=num_photos,
                truth=found if is_model(found) else None,
                pairs=_read_pairs(lists[0]) if lists else None,
            )
    return BenchmarkScene(name=home.name, photos=photos, num_photos=num_photos)


def with_landmarks(scene: BenchmarkScene) -> BenchmarkScene:
    """The scene with its landmarks, which its photos are named after and numbered:
    ``london_bridge_19481797_2295892421.jpg``."""
    names = [photo.name.casefold() for photo in list_photos(scene.photos)]
    return replace(scene, landmarks={name: _NUMBERS.sub("", name) for name in names})


def limited_to(scene: BenchmarkScene, names: Iterable[str]) -> BenchmarkScene:
    """The scene with only the pairs of these photos: no others can be in a model."""
    if scene.truth is None:
        return scene
    arriving = {name.casefold() for name in names}
    truth = read_model(scene.truth)
    pairs = scene.pairs or combinations([truth.images[i].name for i in truth.reg_image_ids()], 2)
    kept = tuple(pair for pair in pairs if arriving.issuperset(map(str.casefold, pair)))
    return replace(scene, pairs=kept)


def _read_pairs(file: Path) -> tuple[NamePair, ...]:
    pairs = []
    for number, line in enumerate(file.read_text("utf-8").splitlines(), start=1):
        names = line.split()
        if not names:
            continue
        if len(names) < 2:
            raise InputError(f"{file}, line {number}: expected two photo names, got {line!r}")
        pairs.append((names[0], names[1]))
    return tuple(pairs)

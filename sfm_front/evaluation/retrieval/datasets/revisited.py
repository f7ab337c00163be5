"""Revisited Oxford and Paris: 70 queries each, in three degrees of difficulty.

Source: Radenovic et al., "Revisiting Oxford and Paris: large-scale image retrieval benchmarking",
CVPR 2018.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from sfm_front.errors import InputError
from sfm_front.evaluation.retrieval.datasets.oxford import OXFORD_SOURCE, PARIS_SOURCE
from sfm_front.evaluation.retrieval.datasets.photo_files import photos_by_stem, require
from sfm_front.evaluation.retrieval.datasets.plain_pickle import read_plain_pickle
from sfm_front.evaluation.retrieval.types import Dataset, Query

ANNOTATION_SOURCE = "http://cmp.felk.cvut.cz/revisitop/data/datasets"

#: What counts as relevant and as junk, by difficulty.
DIFFICULTIES: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "easy": (("easy",), ("junk", "hard")),
    "medium": (("easy", "hard"), ("junk",)),
    "hard": (("hard",), ("junk", "easy")),
}


def load(folder: Path, name: str, source: str) -> tuple[Dataset, ...]:
    """Datasets ``NAME easy``, ``NAME medium`` and ``NAME hard`` over the same photos.

    ``folder`` holds ``gnd_NAME.pkl`` and the photos, at any depth. The photos of queries are not
    among those searched. Raises ``InputError`` if a part is missing.
    """
    annotation = next(iter(sorted(folder.rglob(f"gnd_{name}.pkl"))), None)
    if annotation is None:
        raise InputError(f"{folder}: no gnd_{name}.pkl; get it from {ANNOTATION_SOURCE}/{name}")
    searched, asked, queries = _read(annotation)
    found = photos_by_stem(folder)
    require(found, [*searched, *asked], folder, name, source)
    photos = {photo: found[photo] for photo in searched}
    query_photos = {photo: found[photo] for photo in asked}
    return tuple(
        Dataset(f"{name} {difficulty}", photos, queries[difficulty], query_photos)
        for difficulty in DIFFICULTIES
    )


load_roxford5k = partial(load, name="roxford5k", source=OXFORD_SOURCE)
load_rparis6k = partial(load, name="rparis6k", source=PARIS_SOURCE)


def _read(annotation: Path) -> tuple[list[str], list[str], dict[str, tuple[Query, ...]]]:
    """Names of the indexed photos and of the query photos, and the queries by difficulty."""
    content = read_plain_pickle(annotation)
    try:
        searched = [str(name) for name in content["imlist"]]
        asked = [str(name) for name in content["qimlist"]]
        queries = {
            difficulty: tuple(
                _query(photo, truth, searched, difficulty)
                for photo, truth in zip(asked, content["gnd"], strict=True)
            )
            for difficulty in DIFFICULTIES
        }
    except (KeyError, TypeError, IndexError, ValueError) as error:
        raise InputError(
            f"{annotation}: not the annotation of a revisited dataset ({error!r}); "
            f"get it from {ANNOTATION_SOURCE}"
        ) from error
    return searched, asked, queries


def _query(photo: str, truth: Mapping[str, Any], searched: Sequence[str], difficulty: str) -> Query:
    def named(kinds: Sequence[str]) -> frozenset[str]:
        return frozenset(searched[int(index)] for kind in kinds for index in truth[kind])

    relevant, junk = DIFFICULTIES[difficulty]
    left, top, right, bottom = map(float, truth["bbx"])
    return Query(photo, photo, named(relevant), named(junk), (left, top, right, bottom))

"""Answers of a method to a few queries as a contact sheet, as in the paper's figures 6 to 9."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from sfm_front.evaluation.retrieval.material import Material, key_of
from sfm_front.evaluation.retrieval.types import Dataset, Method, Query, Ranked
from sfm_front.viewers.contact_sheet import SHOWN, SheetRow, Tile, contact_sheet

if TYPE_CHECKING:
    from PIL.Image import Image


def results_sheet(
    method: Method, material: Material, dataset: Dataset, queries: Sequence[Query]
) -> Image:
    """One row per query: its best answers, wrong ones framed red.

    Ignored photos are left out, and distractors, which have no pixels. ``method`` must have been
    built on the photos of ``material``.
    """
    return contact_sheet([_row(method, material, dataset, query) for query in queries])


def _row(method: Method, material: Material, dataset: Dataset, query: Query) -> SheetRow:
    photos = {**dataset.photos, **dataset.query_photos}
    tiles: list[Tile] = []
    for ranked in method.rank(material.queries[key_of(query)]):
        name = material.names.get(ranked.image_id)
        if name is None or name in query.ignored:
            continue
        shown = f"{len(tiles) + 1}  {name}"
        tiles.append(Tile(photos[name], shown, _detail(ranked), wrong=name not in query.relevant))
        if len(tiles) == SHOWN:
            break
    return SheetRow(Tile(photos[query.photo], query.name, f"query, {method.name}"), tiles)


def _detail(ranked: Ranked) -> str:
    if ranked.cosine is None and ranked.inliers is None:
        return f"score {ranked.score:.3f}"
    told = [] if ranked.cosine is None else [f"cosine {ranked.cosine:.3f}"]
    if ranked.inliers is not None:
        told.append(f"{ranked.inliers} inliers")
    return ", ".join(told)

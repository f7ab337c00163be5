"""Global vectors of a dataset projected to a plane, as in the paper's figure 5."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sfm_front.evaluation.retrieval.material import Material, key_of
from sfm_front.evaluation.retrieval.types import Query
from sfm_front.types import Float32Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_UNRELATED, _RELATED, _QUERY = "#b9c2cc", "#2a78b8", "#d1495b"


class Plane:
    """The plane of largest variance through the mean of vectors: PCA to two dimensions."""

    def __init__(self, vectors: Float32Array) -> None:
        """``vectors`` (n, d): at least two, not all equal."""
        self._mean = vectors.mean(axis=0)
        centred = vectors - self._mean
        # n is far smaller than d: (n, n) products instead of (d, d).
        variances, directions = np.linalg.eigh((centred @ centred.T).astype(np.float64))
        axes = directions[:, :-3:-1].T @ centred
        self._axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        self.shown_variance = float(variances[-2:].sum() / variances.sum())
        """The fraction of the vectors' variance in the plane, in [0, 1]."""

    def project(self, vectors: Float32Array) -> NDArray[np.float64]:
        """(n, d) → (n, 2)."""
        projected: NDArray[np.float64] = (vectors - self._mean) @ self._axes.T
        return projected


def draw_planes(material: Material, queries: Sequence[Query], names: Sequence[str]) -> Figure:
    """One row per query, one column per global vector in ``names``.

    Photos ignored for a query are left out of its row.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2 * len(names), 3.9 * len(queries)), layout="constrained")
    panels = figure.subplots(len(queries), len(names), squeeze=False)
    for column, name in enumerate(names):
        vectors = np.stack([photo.vectors[name] for photo in material.photos])
        plane = Plane(vectors)
        places = plane.project(vectors)
        for panel, query in zip(panels[:, column], queries, strict=True):
            asked = material.queries[key_of(query)].vectors[name]
            _draw(panel, places, plane.project(asked[np.newaxis])[0], query, material)
            share = f"{100 * plane.shown_variance:.0f} % of variance"
            panel.set_title(f"{name} ({share})\n{query.name}", fontsize=8)
    panels[0, 0].legend(fontsize=7, loc="best")
    return figure


def _draw(
    panel: Axes,
    places: NDArray[np.float64],
    asked: NDArray[np.float64],
    query: Query,
    material: Material,
) -> None:
    names = [material.names[photo.view.image_id] for photo in material.photos]
    related = np.array([name in query.relevant for name in names])
    ignored = np.array([name in query.ignored for name in names])
    for shown, size, color, marker, label in (
        (places[~related & ~ignored], 9, _UNRELATED, "o", "unrelated"),
        (places[related], 14, _RELATED, "o", "related"),
        (asked[np.newaxis], 110, _QUERY, "*", "query"),
    ):
        x, y = shown.T
        panel.scatter(x, y, s=size, color=color, marker=marker, label=label, linewidths=0)
    panel.set_aspect("equal", adjustable="datalim")
    panel.tick_params(labelsize=7)

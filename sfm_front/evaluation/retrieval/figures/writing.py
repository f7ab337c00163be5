"""Write all figures of a run to a folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from sfm_front.evaluation.reconstruction.chart import save_figure
from sfm_front.evaluation.retrieval.figures.first_layer import draw_first_layer, first_layer
from sfm_front.evaluation.retrieval.figures.results import results_sheet
from sfm_front.evaluation.retrieval.figures.vector_plane import draw_planes
from sfm_front.evaluation.retrieval.material import Material, key_of, sampled
from sfm_front.evaluation.retrieval.types import Dataset, Method, Query
from sfm_front.photos.reader import PhotoReader
from sfm_front.types import Skipped
from sfm_front.viewers.pictures import save

NUM_QUERIES = 3
"""Queries shown per dataset, chosen at random but always the same."""


class FigureWriter:
    """Draws the paper's figures, for a few queries per dataset, into a folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def results(self, method: Method, material: Material) -> None:
        """``DATASET_results_METHOD.png``: answers of a built method (figures 6 to 9)."""
        for dataset in material.datasets:
            sheet = results_sheet(method, material, dataset, shown_queries(dataset, material))
            out = self._folder / f"{_file_name(dataset.name)}_results_{_file_name(method.name)}.png"
            out.parent.mkdir(parents=True, exist_ok=True)
            save(sheet, out)

    def vectors(self, names: Sequence[str], material: Material) -> None:
        """``DATASET_vectors.png``: global vectors in a plane (figure 5)."""
        for dataset in material.datasets:
            figure = draw_planes(material, shown_queries(dataset, material), names)
            save_figure(figure, self._folder / f"{_file_name(dataset.name)}_vectors.png")

    def first_layers(self, weights: Mapping[str, Path], material: Material) -> None:
        """``DATASET_first_layer_NETWORK.png``: kernels and their responses (figure 2)."""
        dataset = material.datasets[0]
        query = shown_queries(dataset, material)[0]
        path = {**dataset.photos, **dataset.query_photos}[query.photo]
        photo = PhotoReader().read(path, query.photo)
        assert not isinstance(photo, Skipped), "it was described"
        for network, file in weights.items():
            layer = first_layer(network, file, photo.pixels)
            figure = draw_first_layer(layer, photo.pixels, f"{network}, {query.photo}")
            name = f"{_file_name(dataset.name)}_first_layer_{network}.png"
            save_figure(figure, self._folder / name)


def shown_queries(dataset: Dataset, material: Material) -> tuple[Query, ...]:
    """The queries to draw, of those that could be described and have a relevant photo."""
    usable = tuple(q for q in dataset.queries if q.relevant and key_of(q) in material.queries)
    return sampled(usable, NUM_QUERIES)


def _file_name(text: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "+-" else "_" for letter in text)

"""Figures of the retrieval benchmark: answers, vectors in a plane, first layers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from helpers.bench_photos import ByNumber, small_dataset
from PIL import Image

from sfm_front.evaluation.retrieval.describe import BenchExtraction
from sfm_front.evaluation.retrieval.figures.first_layer import first_layer, mosaic
from sfm_front.evaluation.retrieval.figures.vector_plane import Plane
from sfm_front.evaluation.retrieval.figures.writing import NUM_QUERIES, FigureWriter, shown_queries
from sfm_front.evaluation.retrieval.material import describe
from sfm_front.features.global_descriptors import networks
from sfm_front.features.global_descriptors.cnn import NETWORKS
from sfm_front.features.global_descriptors.unit_vectors import unit_length


def test_the_plane_is_where_vectors_differ_most():
    rng = np.random.default_rng(0)
    inside = rng.normal(size=(40, 2)) * [5, 2]
    axes = np.linalg.qr(rng.normal(size=(300, 2)))[0]
    vectors = (inside @ axes.T + 7 + 0.001 * rng.normal(size=(40, 300))).astype(np.float32)
    plane = Plane(vectors)
    assert plane.shown_variance > 0.999
    projected = plane.project(vectors)
    centred = inside - inside.mean(axis=0)
    # The same figure, turned or mirrored: distances within it stay.
    np.testing.assert_allclose(projected @ projected.T, centred @ centred.T, atol=0.05)
    assert projected[:, 0].std() > projected[:, 1].std()


def test_a_mosaic_stretches_each_tile():
    tiles = np.array([[[1, 3], [2, 1]], [[5, 5], [5, 5]], [[0, 10], [10, 0]]], np.float32)
    picture = mosaic(tiles)
    assert picture.shape == (5, 5)
    np.testing.assert_array_equal(picture[:2, :2], [[0, 1], [0.5, 0]])
    np.testing.assert_array_equal(picture[:2, 3:], 0)
    np.testing.assert_array_equal(picture[:, 2], 1)
    np.testing.assert_array_equal(picture[3:, 3:], 1)


@pytest.mark.parametrize(
    ("name", "kernels", "responses"),
    [
        ("alexnet_fc7", (64, 11, 11, 3), (64, 39, 79)),
        ("resnet101_pool5", (64, 7, 7, 3), (64, 56, 112)),
        ("mobilenet_v2", (32, 3, 3, 3), (32, 80, 160)),
    ],
)
def test_the_first_layer_of_each_network(tmp_path, name, kernels, responses):
    torch.manual_seed(0)
    network = getattr(networks, NETWORKS[name].class_name)()
    torch.save(network.state_dict(), tmp_path / "weights.pth")
    pixels = np.random.default_rng(0).integers(0, 255, (200, 400, 3), np.uint8)
    layer = first_layer(name, tmp_path / "weights.pth", pixels)
    (tmp_path / "weights.pth").unlink()  # pytest keeps the folder, and this is large
    assert layer.kernels.shape == kernels
    assert layer.responses.shape == responses
    assert layer.responses.min() == 0
    assert layer.responses.max() > 0
    first = next(network.parameters()).detach().numpy()
    np.testing.assert_array_equal(layer.kernels[5, :, :, 1], first[5, 1])


def test_figures_of_a_run(tmp_path):
    pytest.importorskip("matplotlib")
    world = small_dataset(tmp_path)
    describer = BenchExtraction(tmp_path / "cache", {}, max_features=200)
    made = describe([world], describer, lambda _: None)
    rng = np.random.default_rng(0)
    vectors = {"v": unit_length(rng.normal(size=(9, 64)).astype(np.float32))}
    numbered = {photo.view.image_id: i for i, photo in enumerate(made.photos)}

    def with_vector(photo):
        return replace(photo, vectors={"v": vectors["v"][numbered.get(photo.view.image_id, 8)]})

    made = replace(
        made,
        photos=[with_vector(photo) for photo in made.photos],
        queries={key: with_vector(photo) for key, photo in made.queries.items()},
    )
    names = {name: image_id for image_id, name in made.names.items()}
    order = [names["1_0.png"], 10**9, names["2_0.png"], names["1_60.png"]]
    answers = {photo.view.image_id: order for photo in made.queries.values()}
    shown = shown_queries(world, made)
    assert [one.name for one in shown] == ["whole", "part", "outside"]
    assert len(shown) == NUM_QUERIES
    writer = FigureWriter(tmp_path / "figures")
    writer.results(ByNumber(answers), made)
    writer.vectors(["v"], made)
    network = getattr(networks, NETWORKS["mobilenet_v2"].class_name)()
    torch.save(network.state_dict(), tmp_path / "weights.pth")
    writer.first_layers({"mobilenet_v2": tmp_path / "weights.pth"}, made)
    assert sorted(file.name for file in (tmp_path / "figures").iterdir()) == [
        "small_first_layer_mobilenet_v2.png",
        "small_results_by_number.png",
        "small_vectors.png",
    ]
    sheet = np.asarray(Image.open(tmp_path / "figures" / "small_results_by_number.png"))
    assert (sheet == (214, 39, 40)).all(axis=2).sum() > 1000  # 2_0.png is framed red

"""The retrieval benchmark: distractors, what methods are given, what is judged, timed, drawn."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import photo_files
import pycolmap
import pytest
import torch
from model_building import model_of
from PIL import Image

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.retrieval import chart, table
from sfm_front.evaluation.retrieval.average_precision import Accuracy
from sfm_front.evaluation.retrieval.benchmark import Outcome, benchmark
from sfm_front.evaluation.retrieval.describe import BenchDescriber
from sfm_front.evaluation.retrieval.distractor_vectors import VectorMaker
from sfm_front.evaluation.retrieval.distractors import WithDistractors
from sfm_front.evaluation.retrieval.figures.first_layer import first_layer, mosaic
from sfm_front.evaluation.retrieval.figures.vector_plane import Plane
from sfm_front.evaluation.retrieval.figures.writing import NUM_QUERIES, FigureWriter, shown_queries
from sfm_front.evaluation.retrieval.material import Material, describe, key_of, sampled
from sfm_front.evaluation.retrieval.run import RetrievalSettings, run
from sfm_front.evaluation.retrieval.types import BenchPhoto, Dataset, Query, Ranked
from sfm_front.features import networks
from sfm_front.features.cnn import NETWORKS
from sfm_front.features.vectors import unit_length
from sfm_front.matching import MatchingOptions, match
from sfm_front.types import Features
from sfm_front.verification import View

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "benchmark_retrieval.py"
SCENES, PHOTOS_A_SCENE, DIMENSION, NUM_FEATURES = 6, 5, 512, 300


def root_sift_like(rng, count):
    raw = rng.gamma(0.5, 1.0, (count, 128))
    return np.minimum(512 * np.sqrt(raw / raw.sum(axis=1, keepdims=True)), 255).astype(np.uint8)


def bench_photo(image_id, vector, rng):
    camera = pycolmap.Camera(
        camera_id=1, model="SIMPLE_PINHOLE", width=640, height=480, params=[500, 320, 240]
    )
    keypoints = rng.uniform(0, [640, 480, 5, 6], (NUM_FEATURES, 4)).astype(np.float32)
    features = Features(
        keypoints, root_sift_like(rng, NUM_FEATURES), np.zeros((NUM_FEATURES, 3), np.uint8)
    )
    return BenchPhoto(
        View(image_id, camera, features), {"v": vector}, rng.integers(0, 256, 8, np.uint8)
    )


@pytest.fixture(scope="module")
def photos():
    """Scenes of photos whose vectors have much in common, more within a scene."""
    rng = np.random.default_rng(0)
    common = rng.normal(size=DIMENSION)
    made = []
    for _ in range(SCENES):
        of_scene = rng.normal(size=DIMENSION)
        for _ in range(PHOTOS_A_SCENE):
            vector = common + of_scene + 0.5 * rng.normal(size=DIMENSION)
            made.append(bench_photo(len(made) + 1, unit_length(vector.astype(np.float32)), rng))
    return made


# Distractors


def test_a_distractor_is_as_near_to_a_photo_as_another_scene_is(photos):
    vectors = np.stack([photo.vectors["v"] for photo in photos])
    scene = np.arange(len(photos)) // PHOTOS_A_SCENE
    unrelated = (vectors @ vectors.T)[scene[:, None] != scene]
    maker = VectorMaker(vectors)
    made = np.stack([maker.make(np.random.default_rng(i)) for i in range(50)])
    np.testing.assert_allclose(np.linalg.norm(made, axis=1), 1, atol=1e-5)
    cosines = made @ vectors.T
    assert abs(np.median(cosines) - np.median(unrelated)) < 0.05
    bare_mean = unit_length(vectors.mean(axis=0)) @ vectors.T
    assert np.median(bare_mean) > np.median(unrelated) + 0.15
    assert cosines.max() < (vectors @ vectors.T)[scene[:, None] == scene].min()


def test_where_photos_have_nothing_in_common_distractors_have_not_either():
    rng = np.random.default_rng(0)
    vectors = unit_length(rng.normal(size=(40, 4096)).astype(np.float32))
    made = np.stack([VectorMaker(vectors).make(np.random.default_rng(i)) for i in range(20)])
    assert np.abs(np.median(made @ vectors.T)) < 0.02
    assert np.abs(made @ vectors.T).max() < 0.3
    # A number of a distractor varies as much as one of a photo.
    assert made.std() == pytest.approx(vectors.std(), rel=0.02)


def test_equal_vectors_stay_as_they_are():
    vectors = np.tile(unit_length(np.ones(100, np.float32)), (3, 1))
    np.testing.assert_allclose(
        VectorMaker(vectors).make(np.random.default_rng(0)), vectors[0], atol=1e-5
    )


def test_distractors_come_after_the_photos_and_are_the_same_again(photos):
    filled = WithDistractors(photos, 100, 50)
    assert len(filled) == 100
    assert list(filled)[: len(photos)] == photos
    again = WithDistractors(photos, 100, 50)[99]
    last = filled[-1]
    np.testing.assert_array_equal(last.vectors["v"], again.vectors["v"])
    np.testing.assert_array_equal(last.view.features.descriptors, again.view.features.descriptors)
    assert not np.array_equal(last.vectors["v"], filled[98].vectors["v"])
    assert len({photo.view.image_id for photo in filled}) == 100
    assert [photo.view.image_id for photo in filled[98:]] == [
        filled[98].view.image_id,
        last.view.image_id,
    ]
    with pytest.raises(IndexError):
        filled[100]
    assert len(WithDistractors(photos, 3, 50)) == len(photos)


def test_features_of_distractors_are_windows_on_one_pool(photos):
    filled = WithDistractors(photos, 100, 50)
    first, second = filled[50].view.features, filled[51].view.features
    assert len(first) == len(second) == 50
    assert first.descriptors.base is second.descriptors.base is not None
    assert (first.keypoints[:, :2] >= 0).all()
    assert (first.keypoints[:, :2] < [640, 480]).all()


def test_a_distractor_has_nobodys_descriptors(photos):
    pool = WithDistractors(photos, 100, 10**6)[-1].view.features
    assert len(pool) == len(photos) * NUM_FEATURES
    own = photos[0].view.features.descriptors
    copies = match(own, pool.descriptors, MatchingOptions(max_angle_rad=0.3, max_ratio=1.0))
    assert len(copies) == 0


# Material


def query(name, photo, relevant, box=None):
    return Query(name, photo, frozenset(relevant), frozenset([photo]), box)


@pytest.fixture
def world(tmp_path):
    names = ["1_0.png", "1_60.png", "2_0.png", "2_60.png"]
    paths = photo_files.save(tmp_path / "photos", *names)
    (tmp_path / "photos" / "broken.png").write_bytes(b"no image")
    by_name = {path.name: path for path in [*paths, tmp_path / "photos" / "broken.png"]}
    outside = photo_files.save(tmp_path / "outside", "1_30.png")[0]
    queries = (
        query("whole", "1_0.png", ["1_60.png"]),
        query("part", "1_0.png", ["1_60.png"], (20.0, 20.0, 300.0, 220.0)),
        query("outside", "outside.png", ["1_0.png", "1_60.png"]),
        query("unreadable", "broken.png", ["2_0.png"]),
    )
    return Dataset("small", by_name, queries, {"outside.png": outside})


@pytest.fixture
def material(world, tmp_path):
    notes = []
    made = describe([world], BenchDescriber(tmp_path / "cache", {}, max_features=200), notes.append)
    return made, notes


def test_photos_and_queries_are_described_once(material, world):
    made, notes = material
    assert sorted(made.names.values()) == ["1_0.png", "1_60.png", "2_0.png", "2_60.png"]
    whole, part, outside, unreadable = map(key_of, world.queries)
    indexed = {made.names[photo.view.image_id]: photo for photo in made.photos}
    assert made.queries[whole] is indexed["1_0.png"]
    assert unreadable not in made.queries
    points = made.queries[part].view.features.keypoints
    assert 0 < len(points) <= len(indexed["1_0.png"].view.features)
    assert made.queries[outside].view.image_id not in made.names
    assert "small: 5 of 5 photos described" in notes
    assert any(note.startswith("broken.png: not an image") for note in notes)


def test_nothing_to_search_is_refused(tmp_path):
    (tmp_path / "broken.png").write_bytes(b"no image")
    dataset = Dataset("bad", {"broken.png": tmp_path / "broken.png"}, ())
    with pytest.raises(InputError, match="bad: none of its 1 photos can be used"):
        describe([dataset], BenchDescriber(tmp_path / "cache", {}), lambda _: None)


def test_nothing_to_ask_is_refused(world, tmp_path):
    last = replace(world, queries=world.queries[-1:])
    with pytest.raises(InputError, match="small: none of its queries can be used"):
        describe([last], BenchDescriber(tmp_path / "cache", {}, max_features=50), lambda _: None)


def test_queries_are_sampled_in_their_order_and_always_the_same():
    queries = tuple(query(str(i), str(i), ["x"]) for i in range(100))
    some = sampled(queries, 10)
    assert len(some) == 10
    assert [int(one.name) for one in some] == sorted(int(one.name) for one in some)
    assert sampled(queries, 10) == some
    assert sampled(queries, None) == sampled(queries, 100) == queries


# Judging and timing


class ByNumber:
    """Answers by a given table; every query takes its time."""

    name = "by number"
    global_vectors = ()

    def __init__(self, answers, seconds=None):
        self.answers, self._seconds = answers, seconds
        self.asked = []
        if seconds is not None:
            self.seconds = seconds

    def build(self, photos):
        self.built = len(photos)

    def rank(self, photo):
        self.asked.append(photo.view.image_id)
        time.sleep(0.01)
        return [Ranked(i, 1.0) for i in self.answers[photo.view.image_id]]


@pytest.fixture
def judged(photos):
    """Two datasets over photos 1 to 4: the second asks the first's queries and expects more."""
    paths = {name: Path(name) for name in "abcd"}
    first = (query("a", "a", ["b"]), query("b", "b", ["a"]))
    second = (query("a", "a", ["b", "c"]), query("c", "c", []))
    chosen = photos[:4]
    keys = {key_of(q): chosen["abcd".index(q.photo)] for q in (*first, *second)}
    return Material(
        (Dataset("first", paths, first), Dataset("second", paths, second)),
        chosen,
        dict(zip([1, 2, 3, 4], "abcd", strict=True)),
        keys,
    )


def test_each_query_is_asked_once_and_judged_by_every_dataset(judged):
    # Photo 99 is a distractor, which nobody asked for.
    method = ByNumber({1: [1, 99, 2, 3], 2: [2, 1], 3: [4]}, {"coarse": 0.25, "fine": 0.5})
    notes = []
    first, second = benchmark(method, judged, notes.append)
    assert sorted(method.asked) == [1, 2, 3]
    assert method.built == first.indexed == 4
    assert first.accuracy.mean_average_precision == pytest.approx((0.25 + 1) / 2)
    assert first.accuracy.first_right == 0.5
    assert second.accuracy.num_queries == 1
    assert second.accuracy.mean_average_precision == pytest.approx((0.25 + 7 / 12) / 2)
    assert first.seconds >= 0.01
    assert first.stage_seconds == {"coarse": 0.25, "fine": 0.5}
    assert [note.split(":")[0] for note in notes] == ["first, by number", "second, by number"]


def test_a_query_that_cannot_be_described_finds_nothing(judged):
    keys = {key: photo for key, photo in judged.queries.items() if key[0] != "b"}
    method = ByNumber({1: [2], 3: [4]})
    first, _ = benchmark(method, replace(judged, queries=keys), lambda _: None)
    assert first.accuracy.num_queries == 2
    assert first.accuracy.mean_average_precision == 0.5
    assert first.stage_seconds == {}


# Table and chart


def outcome(dataset, method, seconds, precision, **stages):
    accuracy = Accuracy(9, precision, 0.5, {5: 0.25, 10: 0.5, 25: 1.0})
    return Outcome(dataset, method, 100, accuracy, seconds, stages, 0.0)


@pytest.fixture
def outcomes():
    return [
        outcome("holidays", "vlad", 0.00025, 0.75),
        outcome("holidays", "ours", 0.125, 0.9375, coarse=0.0005, fine=0.12),
        replace(outcome("pool", "ours", 0.25, 0.5), accuracy=None),
    ]


def test_the_table_has_a_row_a_dataset_and_measure(outcomes):
    lines = [line.split() for line in table.format_table(outcomes).splitlines()]
    assert lines[0] == ["dataset", "measure", "vlad", "ours"]
    assert lines[2:] == [
        ["holidays", "s/query", "0.0003", "0.1250"],
        ["holidays", "coarse", "s", "-", "0.0005"],
        ["holidays", "fine", "s", "-", "0.1200"],
        ["holidays", "mAP", "0.750", "0.938"],
        ["holidays", "P@1", "0.500", "0.500"],
        ["holidays", "R@5", "0.250", "0.250"],
        ["holidays", "R@10", "0.500", "0.500"],
        ["holidays", "R@25", "1.000", "1.000"],
        [],
        ["pool", "s/query", "-", "0.2500"],
    ]


def test_the_csv_has_every_digit(outcomes, tmp_path):
    table.write_csv(outcomes, tmp_path / "new" / "table.csv")
    with (tmp_path / "new" / "table.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["dataset", "measure", "vlad", "ours"]
    assert rows[1] == ["holidays", "s/query", "0.00025", "0.125"]
    assert rows[2] == ["holidays", "coarse s", "", "0.0005"]
    with pytest.raises(InputError, match="cannot be written"):
        table.write_csv(outcomes, tmp_path)


def test_the_chart_is_written(outcomes, tmp_path):
    pytest.importorskip("matplotlib")
    chart.write_chart(outcomes, tmp_path / "chart.png", highlighted=["ours"])
    assert Image.open(tmp_path / "chart.png").size[0] > 1000


# Figures


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


def test_figures_of_a_run(material, world, tmp_path):
    pytest.importorskip("matplotlib")
    made, _ = material
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


# The whole run, and the script


def pool_of(folder):
    """Two scenes; models that say that each one's photos share points."""
    for seed in (1, 2):
        names = [f"{seed}_{shift}.png" for shift in (0, 40, 80)]
        photo_files.save(folder / str(seed) / "images", *names)
        model = folder / str(seed) / "sparse" / "0"
        model.mkdir(parents=True)
        model_of(25 * [tuple(names)]).write(model)
    return folder


def test_the_whole_run(tmp_path):
    settings = RetrievalSettings(
        datasets=[f"pool:{pool_of(tmp_path / 'pool')}"],
        methods=["phash", "exhaustive"],
        threads=1,
        cache=tmp_path / "cache",
        max_features=300,
        scale=20,
        num_queries=4,
    )
    phash, exhaustive = run(settings, lambda _: None)
    assert (phash.method, exhaustive.method) == ("phash", "exhaustive")
    assert (exhaustive.dataset, exhaustive.indexed) == ("pool pool", 20)
    assert exhaustive.accuracy.num_queries == 4
    assert exhaustive.accuracy.mean_average_precision == 1


def test_the_script_writes_what_it_prints(tmp_path):
    pool = pool_of(tmp_path / "pool")
    done = subprocess.run(
        [
            *(sys.executable, SCRIPT, f"pool:{pool}", "--methods", "phash,exhaustive"),
            *("--cache", tmp_path / "cache", "--threads", "1", "--max-features", "200"),
            *("--json", tmp_path / "a.json", "--csv", tmp_path / "a.csv"),
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "pool pool" in done.stdout
    told = json.loads((tmp_path / "a.json").read_text())
    assert [one["method"] for one in told["outcomes"]] == ["phash", "exhaustive"]
    assert told["settings"]["threads"] == 1
    assert (
        "P@1,0." in (tmp_path / "a.csv").read_text() or "P@1,1" in (tmp_path / "a.csv").read_text()
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--methods", "psychic"], "no retrieval method is called 'psychic'"),
        (["--methods", "phash,phash"], "each once"),
        (["--methods", "phash", "--threads", "0"], "threads must be at least 1"),
        (["--methods", "phash", "--scale", "0"], "scale must be at least 1"),
        (["--weights", "lenet=file"], "give NETWORK=FILE"),
        (["--methods", "phash"], "no scene in it"),
    ],
)
def test_the_script_refuses_before_it_runs(tmp_path, arguments, message):
    done = subprocess.run(
        [sys.executable, SCRIPT, f"pool:{tmp_path}", *arguments],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_settings_name_what_is_wrong(tmp_path):
    with pytest.raises(ConfigError, match="name one method at least"):
        RetrievalSettings(datasets=["pool:x"], methods=[], threads=1, cache=tmp_path)

"""Photos, queries and answers of the retrieval benchmark, for tests."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pycolmap

from helpers import photo_files
from sfm_front.evaluation.retrieval.types import BenchPhoto, Dataset, Query, Ranked
from sfm_front.types import Features, View

NUM_FEATURES = 300


def root_sift_like(rng: np.random.Generator, count: int) -> np.ndarray:
    raw = rng.gamma(0.5, 1.0, (count, 128))
    return np.minimum(512 * np.sqrt(raw / raw.sum(axis=1, keepdims=True)), 255).astype(np.uint8)


def bench_photo(image_id: int, vector: np.ndarray, rng: np.random.Generator) -> BenchPhoto:
    """A photo with this vector, called "v", and random features and perceptual hash."""
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


def query(
    name: str,
    photo: str,
    relevant: Iterable[str],
    box: tuple[float, float, float, float] | None = None,
) -> Query:
    """A query that ignores its own photo."""
    return Query(name, photo, frozenset(relevant), frozenset([photo]), box)


def small_dataset(folder: Path) -> Dataset:
    """Two scenes of two photos, an unreadable one, and queries of every kind."""
    names = ["1_0.png", "1_60.png", "2_0.png", "2_60.png"]
    paths = photo_files.save(folder / "photos", *names)
    (folder / "photos" / "broken.png").write_bytes(b"no image")
    by_name = {path.name: path for path in [*paths, folder / "photos" / "broken.png"]}
    outside = photo_files.save(folder / "outside", "1_30.png")[0]
    queries = (
        query("whole", "1_0.png", ["1_60.png"]),
        query("part", "1_0.png", ["1_60.png"], (20.0, 20.0, 300.0, 220.0)),
        query("outside", "outside.png", ["1_0.png", "1_60.png"]),
        query("unreadable", "broken.png", ["2_0.png"]),
    )
    return Dataset("small", by_name, queries, {"outside.png": outside})


class ByNumber:
    """Answers from a given table; every query takes at least 10 ms."""

    name = "by number"
    global_vectors = ()

    def __init__(self, answers, seconds=None):
        self.answers = answers
        self.asked = []
        if seconds is not None:
            self.seconds = seconds

    def build(self, photos):
        self.built = len(photos)

    def rank(self, photo):
        self.asked.append(photo.view.image_id)
        time.sleep(0.01)
        return [Ranked(i, 1.0) for i in self.answers[photo.view.image_id]]

"""Describing photos ahead: order, bounds, bad files, and the same on any number of threads."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.library_threads import library_threads, several_threads
from PIL import Image

from sfm_front.features.extraction import FeatureExtraction
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.features.sift import SiftExtractor, SiftOptions
from sfm_front.photos.reader import PhotoReader
from sfm_front.types import ExtractedPhoto, PhotoPath, Skipped, SkipReason

VECTOR_TOLERANCE = 1e-6  # float32


class MeanColour:
    """A network's stand-in: three numbers of the pixels, and the thread it ran on."""

    name = "mean"
    dimension = 3
    fingerprint = "mean"

    def __init__(self) -> None:
        self.threads: list[int] = []

    def describe(self, pixels: np.ndarray) -> np.ndarray:
        self.threads.append(threading.get_ident())
        mean = pixels.mean(axis=(0, 1)).astype(np.float32)
        return mean / np.linalg.norm(mean)


@pytest.fixture(scope="module")
def photos(tmp_path_factory) -> list[PhotoPath]:
    """Six photos; the third is no image and the fifth has no texture."""
    folder = tmp_path_factory.mktemp("photos")
    rng = np.random.default_rng(0)
    made = []
    for number in range(6):
        path = folder / f"{number}.png"
        if number == 2:
            path.write_text("no image")
        elif number == 4:
            Image.new("RGB", (160, 120), (90, 120, 30)).save(path)
        else:
            coarse = Image.fromarray(rng.integers(0, 256, (20, 26, 3), dtype=np.uint8))
            coarse.resize((208, 160), Image.Resampling.BICUBIC).save(path)
        made.append(PhotoPath(f"flight/{path.name}", path))
    return made


def describer(num_threads: int, network: MeanColour | None = None) -> FeatureExtraction:
    networks = [] if network is None else [network]
    return FeatureExtraction(
        PhotoReader(),
        SiftExtractor(SiftOptions(max_features=200)),
        GlobalDescriptor(networks=networks, local=[Vlad()]),
        num_threads=num_threads,
    )


def content(photo: ExtractedPhoto | Skipped) -> object:
    if isinstance(photo, Skipped):
        return photo
    features = photo.features
    arrays = features.keypoints, features.descriptors, features.colors, photo.global_vector
    return photo.name, photo.digest, *(array.tobytes() for array in arrays)


@pytest.mark.parametrize("num_threads", [1, 3])
def test_photos_come_in_order_with_the_bad_ones_named(photos, num_threads):
    with describer(num_threads) as describe:
        results = list(describe.stream(photos))
    assert [result.name for result in results] == [photo.name for photo in photos]
    skipped = {r.name: r.reason for r in results if isinstance(r, Skipped)}
    assert skipped == {
        "flight/2.png": SkipReason.NOT_AN_IMAGE,
        "flight/4.png": SkipReason.NO_FEATURES,
    }


def test_threads_do_not_change_what_is_described(photos):
    with describer(1, MeanColour()) as describe:
        one_by_one = [content(describe.describe(photo)) for photo in photos]
    for num_threads in (1, 3):
        with describer(num_threads, MeanColour()) as describe:
            assert [content(result) for result in describe.stream(photos)] == one_by_one


def test_a_photo_is_what_its_parts_say(photos):
    with describer(1) as describe:
        result = describe.describe(photos[0])
    assert isinstance(result, ExtractedPhoto)
    photo = PhotoReader().read(photos[0].path, photos[0].name)
    assert (result.path, result.width, result.height) == (photos[0].path, 208, 160)
    assert result.digest == photo.digest
    features = SiftExtractor(SiftOptions(max_features=200)).extract(photo)
    np.testing.assert_array_equal(result.features.keypoints, features.keypoints)
    np.testing.assert_array_equal(result.features.descriptors, features.descriptors)
    expected = GlobalDescriptor(local=[Vlad()]).describe(photo.pixels, features)
    np.testing.assert_allclose(result.global_vector, expected, atol=VECTOR_TOLERANCE)
    assert set(result.seconds) == {"read", "sift", "vlad"}


def test_the_network_runs_beside_sift(photos):
    network = MeanColour()
    with describer(1, network) as describe:
        result = describe.describe(photos[0])
    assert isinstance(result, ExtractedPhoto)
    assert set(result.seconds) == {"read", "sift", "vlad", "network"}
    assert len(network.threads) == 1
    assert network.threads[0] != threading.get_ident()
    assert len(result.global_vector) == Vlad().dimension + 3
    assert np.linalg.norm(result.global_vector) == pytest.approx(1, abs=VECTOR_TOLERANCE)


def test_no_more_photos_are_taken_than_are_worked_on(photos):
    """Else a long flight would be read into memory while the first photos are mapped."""
    taken = 0

    def counted() -> Iterator[PhotoPath]:
        nonlocal taken
        for photo in photos * 5:
            taken += 1
            yield photo

    with describer(2) as describe:
        stream = describe.stream(counted())
        for given in range(1, 11):
            next(stream)
            assert taken - given < 2 * 2
        stream.close()
    assert taken < 30


def test_a_stream_that_is_still_held_ends_with_its_describer(photos):
    """Else OpenCV would stay on one thread."""
    with several_threads() as before:
        with describer(2) as describe:
            stream = describe.stream(photos)
            next(stream)
            assert cv2.getNumThreads() == 1
        assert library_threads() == before
        assert list(stream) == []


def test_a_file_that_is_gone_is_skipped(tmp_path: Path):
    with describer(1) as describe:
        result = describe.describe(PhotoPath("a.jpg", tmp_path / "a.jpg"))
    assert isinstance(result, Skipped)
    assert result.reason is SkipReason.UNREADABLE


def test_nothing_to_describe_is_nothing():
    with describer(2) as describe:
        assert list(describe.stream([])) == []

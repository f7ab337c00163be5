"""VLAD against its definition, on descriptors with known clusters."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from sfm_front.errors import ConfigError, InputError
from sfm_front.features.codebook import Codebook, train_codebook
from sfm_front.features.vlad import Vlad
from sfm_front.types import Features

FLOAT32_NOISE = 1e-5


def random_descriptors(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (count, 128), dtype=np.uint8)


def features_of(descriptors: np.ndarray, seed: int = 0) -> Features:
    """Features at random places and scales."""
    generator = np.random.default_rng(seed)
    keypoints = generator.uniform(1, 20, (len(descriptors), 4)).astype(np.float32)
    return Features(keypoints, descriptors, np.zeros((len(descriptors), 3), np.uint8))


@pytest.fixture(scope="module")
def codebook() -> Codebook:
    return train_codebook(random_descriptors(2000), num_words=8, dimension=16, seed=1)


def by_definition(codebook: Codebook, features: Features) -> np.ndarray:
    """VLAD written out one feature at a time."""
    mean, projection, words = (
        array.astype(np.float64) for array in (codebook.mean, codebook.projection, codebook.words)
    )
    sums = np.zeros_like(words)
    for keypoint, descriptor in zip(features.keypoints, features.descriptors, strict=True):
        point = (descriptor - mean) @ projection
        distances = np.linalg.norm(words - point, axis=1)
        residual = point - words[distances.argmin()]
        sums[distances.argmin()] += residual / np.linalg.norm(residual) * keypoint[2] ** 0.5
    for row in sums:
        row /= np.linalg.norm(row) or 1.0
    return sums.ravel() / np.linalg.norm(sums)


@pytest.mark.parametrize("count", [1, 3, 500])
def test_it_is_what_the_definition_says(codebook, count):
    features = features_of(random_descriptors(count, seed=count))
    vector = Vlad(codebook).describe(features)
    assert vector.dtype == np.float32
    assert vector.shape == (8 * 16,) == (Vlad(codebook).dimension,)
    np.testing.assert_allclose(vector, by_definition(codebook, features), atol=FLOAT32_NOISE)


def test_no_descriptors_give_zeros(codebook):
    assert not Vlad(codebook).describe(features_of(random_descriptors(0))).any()


def test_the_unit_of_scale_does_not_matter(codebook):
    features = features_of(random_descriptors(300))
    enlarged = Features(features.keypoints * 7, features.descriptors, features.colors)
    vlad = Vlad(codebook)
    np.testing.assert_allclose(vlad.describe(features), vlad.describe(enlarged), atol=FLOAT32_NOISE)


def test_photos_that_share_descriptors_are_closer_than_strangers():
    vlad = Vlad()
    shared, mine, yours, strange = (random_descriptors(400, seed) for seed in range(4))
    query, overlapping, stranger = (
        vlad.describe(features_of(descriptors))
        for descriptors in (
            np.concatenate([shared, mine]),
            np.concatenate([shared, yours]),
            np.concatenate([strange, yours]),
        )
    )
    assert query @ overlapping > query @ stranger + 0.1


def test_training_finds_the_clusters():
    generator = np.random.default_rng(0)
    centres = generator.integers(40, 200, (5, 128))
    labels = generator.integers(0, 5, 1000)
    descriptors = (centres[labels] + generator.normal(0, 2, (1000, 128))).astype(np.uint8)
    # More words than clusters, so that no draw of the first words can leave a cluster without one.
    codebook = train_codebook(descriptors, num_words=40, dimension=4)
    projected = (centres - codebook.mean) @ codebook.projection
    distances = np.linalg.norm(projected[:, None] - codebook.words[None], axis=2)
    spread = np.linalg.norm(projected[0] - projected[1])
    assert len(set(distances.argmin(axis=1))) == 5
    assert distances.min(axis=1).max() < 0.05 * spread


def test_the_projection_whitens_by_half():
    scales = np.linspace(30, 1, 128)
    noise = np.random.default_rng(0).normal(size=(4000, 128))
    descriptors = np.clip(128 + scales * noise, 0, 255).astype(np.uint8)
    codebook = train_codebook(descriptors, num_words=1, dimension=16)
    projected = (descriptors - codebook.mean.astype(np.float32)) @ codebook.projection
    # A component of deviation s comes out with the deviation sqrt(s).
    np.testing.assert_allclose(projected.std(axis=0), np.sqrt(scales[:16]), rtol=0.1)


def test_training_twice_gives_the_same_words_and_another_seed_others(codebook):
    descriptors = random_descriptors(2000)
    again = train_codebook(descriptors, num_words=8, dimension=16, seed=1)
    other = train_codebook(descriptors, num_words=8, dimension=16, seed=2)
    assert again.fingerprint == codebook.fingerprint
    assert other.fingerprint != codebook.fingerprint


def test_a_codebook_survives_its_file(codebook, tmp_path):
    file = tmp_path / "words.npz"
    codebook.save(file)
    loaded = Codebook.load(file)
    assert loaded.fingerprint == codebook.fingerprint
    np.testing.assert_array_equal(loaded.words, codebook.words)
    assert Vlad(loaded).fingerprint == Vlad(codebook).fingerprint


def test_the_shipped_codebook_is_small_and_sound():
    vlad = Vlad()
    vector = vlad.describe(features_of(random_descriptors(100)))
    assert vector.shape == (vlad.dimension,)
    assert np.linalg.norm(vector) == pytest.approx(1.0, abs=FLOAT32_NOISE)


def make_text(file):
    file.write_text("words")


def make_other_arrays(file):
    np.savez(file, words=np.zeros((2, 2)))


def make_misfit(file):
    np.savez(file, mean=np.zeros(128), projection=np.zeros((128, 4)), words=np.zeros((2, 5)))


@pytest.mark.parametrize("make", [make_text, make_other_arrays, make_misfit, lambda _: None])
def test_what_is_no_codebook_is_refused(make, tmp_path):
    file = tmp_path / "words.npz"
    make(file)
    with pytest.raises(InputError, match=r"words\.npz: not a VLAD codebook"):
        Codebook.load(file)


@pytest.mark.parametrize(("num_words", "dimension"), [(0, 8), (101, 8), (4, 0), (4, 129)])
def test_impossible_sizes_are_refused(num_words, dimension):
    with pytest.raises(ConfigError, match="must be 1 to"):
        train_codebook(random_descriptors(100), num_words=num_words, dimension=dimension)


SCRIPT = Path(__file__).parents[1] / "scripts" / "make_vlad_codebook.py"


def run_script(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_script_learns_from_a_folder_of_photos(tmp_path):
    generator = np.random.default_rng(0)
    for number in range(2):
        pixels = generator.integers(0, 256, (30, 40, 3), dtype=np.uint8)
        photo = cv2.resize(pixels, (320, 240), interpolation=cv2.INTER_CUBIC)
        cv2.imwrite(str(tmp_path / f"{number}.png"), photo)
    (tmp_path / "broken.png").write_bytes(b"no photo")
    output = tmp_path / "words.npz"
    sizes = ("--words", 6, "--dimension", 10)
    done = run_script(tmp_path, "--output", output, *sizes)
    assert done.returncode == 0, done.stderr
    assert "broken.png" in done.stderr
    codebook = Codebook.load(output)
    assert codebook.words.shape == (6, 10)
    assert codebook.fingerprint in done.stdout


def test_the_script_names_a_folder_that_is_not_there(tmp_path):
    done = run_script(tmp_path / "absent", "--output", tmp_path / "words.npz")
    assert done.returncode == 2
    assert "absent: no such folder" in done.stderr
    assert "Traceback" not in done.stderr

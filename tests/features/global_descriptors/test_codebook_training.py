"""Learning a codebook, from descriptors whose clusters and spread are known."""

from __future__ import annotations

import subprocess
import sys

import cv2
import numpy as np
import pytest
from helpers.feature_making import features_of, random_descriptors, random_photos
from helpers.locations import SCRIPTS

from sfm_front.errors import ConfigError
from sfm_front.features.global_descriptors.codebook import Codebook
from sfm_front.features.global_descriptors.codebook_training import DAMPING, train_codebook
from sfm_front.features.global_descriptors.visual_words import VisualWords
from sfm_front.types import Features

FLOAT16_NOISE = 0.02


def photos_of(descriptors: np.ndarray, count: int) -> list[Features]:
    return [features_of(part) for part in np.split(descriptors, count)]


def test_it_finds_the_clusters():
    generator = np.random.default_rng(0)
    centres = generator.integers(40, 200, (5, 128))
    labels = generator.integers(0, 5, 1000)
    descriptors = (centres[labels] + generator.normal(0, 2, (1000, 128))).astype(np.uint8)
    # More words than clusters, so that no draw of the first words can leave a cluster without one.
    codebook = train_codebook(photos_of(descriptors, 5), num_words=40, dimension=4)
    projected = (centres - codebook.mean) @ codebook.projection
    distances = np.linalg.norm(projected[:, None] - codebook.words[None], axis=2)
    spread = np.linalg.norm(projected[0] - projected[1])
    assert len(set(distances.argmin(axis=1))) == 5
    assert distances.min(axis=1).max() < 0.05 * spread


def test_the_projection_whitens_by_half():
    scales = np.linspace(30, 1, 128)
    noise = np.random.default_rng(0).normal(size=(4000, 128))
    descriptors = np.clip(128 + scales * noise, 0, 255).astype(np.uint8)
    codebook = train_codebook(photos_of(descriptors, 10), num_words=1, dimension=16)
    projected = (descriptors - codebook.mean.astype(np.float32)) @ codebook.projection
    # A component of deviation s comes out with the deviation sqrt(s).
    np.testing.assert_allclose(projected.std(axis=0), np.sqrt(scales[:16]), rtol=0.1)


def test_the_whitening_evens_out_what_photos_have_at_a_word():
    photos = random_photos(60, 40)
    codebook = train_codebook(photos, num_words=3, dimension=4)
    words = VisualWords(codebook.mean, codebook.projection, codebook.words)
    directions = np.stack([words.directions(photo) for photo in photos])
    damping = DAMPING / 4 * np.eye(4)
    for word, matrix in enumerate(codebook.whitening.astype(np.float64)):
        at_word = directions[:, word]
        moments = at_word.T @ at_word / len(photos) + damping
        np.testing.assert_allclose(matrix @ moments @ matrix.T, np.eye(4), atol=FLOAT16_NOISE)
        assert not np.triu(matrix, 1).any()


def test_a_photo_without_features_does_no_harm():
    photos = [*random_photos(20, 40), features_of(random_descriptors(0))]
    codebook = train_codebook(photos, num_words=3, dimension=4)
    assert np.isfinite(codebook.whitening).all()


def test_twice_gives_the_same_words_and_another_seed_others():
    photos = random_photos(20, 100)
    once, again, other = (
        train_codebook(photos, num_words=8, dimension=16, seed=seed) for seed in (1, 1, 2)
    )
    assert again.fingerprint == once.fingerprint
    assert other.fingerprint != once.fingerprint


@pytest.mark.parametrize(("num_words", "dimension"), [(0, 8), (101, 8), (4, 0), (4, 129)])
def test_impossible_sizes_are_refused(num_words, dimension):
    with pytest.raises(ConfigError, match="must be 1 to"):
        train_codebook(random_photos(2, 50), num_words=num_words, dimension=dimension)


def test_no_photos_are_refused():
    with pytest.raises(ConfigError, match="number of descriptors"):
        train_codebook([], num_words=1, dimension=8)


SCRIPT = SCRIPTS / "make_vlad_codebook.py"


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

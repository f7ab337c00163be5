"""The codebook's file."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from sfm_front.errors import ConfigError, InputError
from sfm_front.features.global_descriptors.codebook import Codebook
from sfm_front.features.global_descriptors.vlad import Vlad


def random_codebook(seed: int = 0) -> Codebook:
    generator = np.random.default_rng(seed)
    shapes = (128,), (128, 4), (5, 4), (5, 4, 4)
    return Codebook(*(generator.normal(size=shape).astype(np.float16) for shape in shapes))


def test_a_codebook_survives_its_file(tmp_path):
    codebook = random_codebook()
    file = tmp_path / "words.npz"
    codebook.save(file)
    loaded = Codebook.load(file)
    for field in fields(Codebook):
        np.testing.assert_array_equal(getattr(loaded, field.name), getattr(codebook, field.name))
    assert loaded.fingerprint == codebook.fingerprint
    assert Vlad(loaded).fingerprint == Vlad(codebook).fingerprint


@pytest.mark.parametrize("name", [field.name for field in fields(Codebook)])
def test_every_array_counts_in_the_fingerprint(name):
    codebook = random_codebook()
    changed = replace(codebook, **{name: getattr(codebook, name) * np.float16(2)})
    assert changed.fingerprint != codebook.fingerprint


@pytest.mark.parametrize("name", [field.name for field in fields(Codebook)])
def test_arrays_that_do_not_fit_each_other_are_refused(name):
    codebook = random_codebook()
    with pytest.raises(ConfigError, match="inconsistent codebook shapes"):
        replace(codebook, **{name: getattr(codebook, name)[:-1]})


def make_text(file):
    file.write_text("words")


def make_other_arrays(file):
    np.savez(file, words=np.zeros((2, 2)))


def make_misfit(file):
    arrays = {"mean": (128,), "projection": (128, 4), "words": (2, 5), "whitening": (2, 5, 5)}
    np.savez(file, **{name: np.zeros(shape) for name, shape in arrays.items()})


@pytest.mark.parametrize("make", [make_text, make_other_arrays, make_misfit, lambda _: None])
def test_what_is_no_codebook_is_refused(make, tmp_path):
    file = tmp_path / "words.npz"
    make(file)
    with pytest.raises(InputError, match=r"words\.npz: not a VLAD codebook"):
        Codebook.load(file)

"""VLAD's learnt codebook: a small file that ships with the package."""

from __future__ import annotations

import hashlib
import zipfile
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sfm_front.errors import ConfigError, InputError

SIFT_DIMENSION = 128
SHIPPED_CODEBOOK = Path(__file__).with_name("vlad_codebook.npz")

Float16Array = NDArray[np.float16]


@dataclass(frozen=True, slots=True, eq=False)
class Codebook:
    """Visual words and their whitening, float16 to keep the shipped file small.

    ``mean`` (128,) is subtracted from a descriptor, ``projection`` (128, d) reduces the difference
    and half whitens it, ``words`` (k, d) are the cluster centres in that space. ``whitening``
    (k, d, d) holds one lower triangular matrix per word, which decorrelates the residuals at that
    word and gives them equal variance.
    """

    mean: Float16Array
    projection: Float16Array
    words: Float16Array
    whitening: Float16Array

    def __post_init__(self) -> None:
        """Raises ConfigError if the shapes do not fit each other."""
        shapes = [array.shape for array in astuple(self)]
        if self.words.ndim == 2:
            count, dimension = self.words.shape
            fitting = [
                (SIFT_DIMENSION,),
                (SIFT_DIMENSION, dimension),
                (count, dimension),
                (count, dimension, dimension),
            ]
            if shapes == fitting:
                return
        raise ConfigError(
            f"inconsistent codebook shapes {', '.join(map(str, shapes))}: "
            "expected (128,), (128, d), (k, d), (k, d, d)"
        )

    @property
    def fingerprint(self) -> str:
        """Eight hexadecimal digits; vectors of codebooks with different ones are not comparable."""
        digest = hashlib.sha256()
        for array in astuple(self):
            digest.update(repr(array.shape).encode())
            digest.update(np.ascontiguousarray(array, "<f2").tobytes())
        return digest.hexdigest()[:8]

    def save(self, file: Path) -> None:
        """Write the ``.npz`` that ``load`` reads."""
        with file.open("wb") as stream:
            np.savez_compressed(stream, **{f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def load(cls, file: Path = SHIPPED_CODEBOOK) -> Codebook:
        """Raises InputError if ``file`` is no codebook."""
        try:
            with np.load(file, allow_pickle=False) as arrays:
                return cls(*(arrays[f.name] for f in fields(cls)))
        except (
            OSError,
            ValueError,
            TypeError,
            KeyError,
            EOFError,
            zipfile.BadZipFile,
            ConfigError,
        ) as error:
            raise InputError(
                f"{file}: not a VLAD codebook. Make one with scripts/make_vlad_codebook.py."
            ) from error

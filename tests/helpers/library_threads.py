"""How many threads libraries use, and cores to take from them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import cv2
import faiss  # noqa: F401  # brings a BLAS, whatever NumPy has
import numpy as np  # noqa: F401
import pytest
from threadpoolctl import threadpool_info, threadpool_limits


def blas_threads() -> set[int]:
    """Of all libraries for matrix products that can be asked."""
    return {
        library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"
    }


def library_threads() -> tuple[int, set[int]]:
    """Of OpenCV and of matrix products."""
    return cv2.getNumThreads(), blas_threads()


needs_blas = pytest.mark.skipif(
    not blas_threads(), reason="NumPy's BLAS, such as Apple's Accelerate, cannot be asked"
)


@contextmanager
def several_threads() -> Iterator[tuple[int, set[int]]]:
    """OpenCV and matrix products use several threads, on a machine with one core too.

    Gives what ``library_threads`` says then.
    """
    opencv = cv2.getNumThreads()
    cv2.setNumThreads(3)
    try:
        with threadpool_limits(2, "blas"):
            before = library_threads()
            assert before[0] > 1
            assert before[1] <= {2}
            yield before
    finally:
        cv2.setNumThreads(opencv)

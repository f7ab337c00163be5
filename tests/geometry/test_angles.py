"""Angles around the circle."""

from __future__ import annotations

import numpy as np

from sfm_front.geometry.angles import FULL_TURN, wrapped


def test_angles_lose_their_whole_turns():
    angles = np.linspace(-3.0, 3.0, 13)
    for turns in (-2, -1, 0, 1, 5):
        np.testing.assert_allclose(wrapped(angles + turns * FULL_TURN), angles, atol=1e-12)
    assert wrapped(np.array([np.pi, -np.pi])).tolist() == [-np.pi, -np.pi]
    assert np.isnan(wrapped(np.array([np.nan]))).all()

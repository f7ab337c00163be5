"""How far a model's cameras are from where GPS had them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.types import Float64Array, GeoPosition

if TYPE_CHECKING:
    import pycolmap

_MIN_POSITIONS = 4  # a similarity fits any two of them, and nearly any three


def gps_residual_m(
    model: pycolmap.Reconstruction, positions: Mapping[str, GeoPosition]
) -> float | None:
    """Median distance in metres between the cameras and their GPS positions, by name of the photo,
    after ``free_fit``. None where there is no such fit."""
    centres, degrees = _located(model, positions)
    if len(centres) < _MIN_POSITIONS:
        return None
    frame = LocalFrame(*degrees.mean(axis=0).tolist())
    enu_from_model = free_fit(model, positions, frame)
    if enu_from_model is None:
        return None
    return _median_distance(enu_from_model * centres, frame.to_enu(degrees))


def gps_residual_as_it_stands_m(
    model: pycolmap.Reconstruction, positions: Mapping[str, GeoPosition], frame: LocalFrame
) -> float | None:
    """The same of a model in ENU, which is not moved. None without a position."""
    centres, degrees = _located(model, positions)
    return _median_distance(centres, frame.to_enu(degrees)) if len(centres) else None


def free_fit(
    model: pycolmap.Reconstruction, positions: Mapping[str, GeoPosition], frame: LocalFrame
) -> pycolmap.Sim3d | None:
    """``enu_from_model`` that moves, turns and scales the cameras to their positions by least
    squares (Umeyama, "Least-squares estimation of transformation parameters between two point
    patterns", PAMI 1991). None for fewer than four positions with an altitude, or if they lie in
    one plane.
    """
    import pycolmap

    centres, degrees = _located(model, positions)
    if len(centres) < _MIN_POSITIONS:
        return None
    return pycolmap.estimate_sim3d(centres, frame.to_enu(degrees))


def _located(
    model: pycolmap.Reconstruction, positions: Mapping[str, GeoPosition]
) -> tuple[Float64Array, Float64Array]:
    """(N, 3) camera centres of the photos whose position and altitude are known, and (N, 3) these:
    degrees, degrees, metres."""
    located = [
        (model.images[image_id].projection_center(), position)
        for image_id in model.reg_image_ids()
        if (position := positions.get(model.images[image_id].name)) is not None
        and position.altitude_m is not None
    ]
    centres = np.array([centre for centre, _ in located], np.float64).reshape(-1, 3)
    return centres, lat_lon_alt(position for _, position in located)


def _median_distance(points: Float64Array, others: Float64Array) -> float:
    return float(np.median(np.linalg.norm(points - others, axis=1)))

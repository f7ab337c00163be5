"""Flights over flat ground with measured positions, in models of a frame of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.georeference.fixes import Fixes
from sfm_front.types import Float64Array

CONSUMER_SIGMAS_M = (5.0, 5.0, 10.0)
HEIGHT_M = 60.0

# cam_from_enu of a camera that flies east: the long side of the photo is across.
_LOOKING_DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


@dataclass(frozen=True)
class Flight:
    """``true`` (N, 3): camera centres in ENU. ``centres`` (N, 3) and ``cam_from_model`` (N, 3, 3):
    the same in the model, which ``enu_from_model`` would take to ENU. ``enu`` (N, 3): measured."""

    true: Float64Array
    enu_from_model: pycolmap.Sim3d
    centres: Float64Array
    cam_from_model: Float64Array
    enu: Float64Array

    def fixes(self, sigmas_m=CONSUMER_SIGMAS_M, flights=None) -> Fixes:
        return Fixes.of(self.enu, np.tile(np.array(sigmas_m), (len(self.enu), 1)), flights)

    def poses(self) -> list[pycolmap.Rigid3d]:
        return [
            pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ centre)
            for rotation, centre in zip(self.cam_from_model, self.centres, strict=True)
        ]


def strips(number: int, extent_m: float = 100.0) -> Float64Array:
    """(N, 3) nadir strips to and fro, in the order of flight."""
    lines = max(2, int(np.sqrt(number / 1.5)))
    per_line = -(-number // lines)
    along = np.linspace(0.0, extent_m, per_line)
    points = [
        (east, 0.6 * extent_m * line / (lines - 1), HEIGHT_M)
        for line in range(lines)
        for east in (along if line % 2 == 0 else along[::-1])
    ]
    return np.array(points[:number])


def line(number: int, extent_m: float = 100.0) -> Float64Array:
    """(N, 3) one strip, nearly to the east."""
    east = np.linspace(0.0, extent_m, number)
    return np.column_stack([east, 0.3 * east, np.full(number, HEIGHT_M)])


def flight(
    true: Float64Array,
    seed: int,
    noise_m: tuple[float, float, float] = (1.0, 1.0, 2.0),
    drift_m: float = 0.0,
    roll_rad: float = 0.0,
) -> Flight:
    """Cameras look down; every second fifth of the photos is flown the other way round.

    ``noise_m``: independent errors by axis; ``drift_m``: standard deviation of errors that wander
    over a third of the flight. ``roll_rad``: all cameras are held out of level by that.
    """
    rng = np.random.default_rng(seed)
    number = len(true)
    model_from_enu = pycolmap.Sim3d(
        float(np.exp(rng.normal())),
        pycolmap.Rotation3d(rng.normal(size=3)),
        10 * rng.normal(size=3),
    )
    turned = np.arange(number) // max(2, number // 5) % 2 * np.pi
    rolled = pycolmap.Rotation3d(np.array([0.0, roll_rad, 0.0])).matrix()
    cam_from_model = np.array(
        [
            rolled
            @ _LOOKING_DOWN
            @ pycolmap.Rotation3d(np.array([0.0, 0.0, heading])).matrix()
            @ model_from_enu.rotation.matrix().T
            for heading in turned + 0.05 * rng.normal(size=number)
        ]
    )
    apart = np.abs(np.arange(number)[:, None] - np.arange(number))
    wander = np.linalg.cholesky(np.exp(-apart / (number / 3)) + 1e-9 * np.eye(number))
    errors = rng.normal(size=(number, 3)) * noise_m
    errors += drift_m * wander @ rng.normal(size=(number, 3))
    return Flight(
        true, model_from_enu.inverse(), model_from_enu * true, cam_from_model, true + errors
    )


def tilt_deg(enu_from_model: pycolmap.Sim3d, photos: Flight) -> float:
    """Angle between up and what a similarity takes for up."""
    up = (enu_from_model.rotation * photos.enu_from_model.rotation.inverse()).matrix()[2]
    return float(np.degrees(np.arctan2(np.hypot(up[0], up[1]), up[2])))


def turned_by_quarters(photos: Flight) -> None:
    """Every third camera is turned about its axis, so that all together show the horizon."""
    quarter = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    photos.cam_from_model[::3] = quarter @ photos.cam_from_model[::3]


def thrown(flight: Flight, rows: np.ndarray, metres: float, seed: int) -> None:
    """Move the positions of some photos away, each in a direction of its own, mostly in the
    plane."""
    away = np.random.default_rng(seed).normal(size=(len(rows), 3)) * (1.0, 1.0, 0.3)
    flight.enu[rows] += metres * away / np.linalg.norm(away, axis=1, keepdims=True)

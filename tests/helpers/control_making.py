"""A flight over surveyed points, made by hand: the truth, and models of it that are wrong."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
import pycolmap

from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.control.marks import PhotoMark
from sfm_front.georeference.control.point_file import ControlPoint
from sfm_front.mapping.bundle_adjustment import adjust_all
from sfm_front.types import GeoPosition

WIDTH, HEIGHT, FOCAL, K1 = 1000, 750, 900.0, -0.08
FLYING_HEIGHT_M = 20.0  # 2.2 cm a pixel
NOISE_PX = 0.3
FRAME = LocalFrame(48.0, 9.0, 300.0)
# East and north of the points, in metres. Every other one of the inner ones is a checkpoint.
CONTROL = ((-14, -12), (14, -12), (-14, 12), (14, 12), (0, 0), (-14, 0), (14, 0), (0, -12))
CHECKPOINTS = ((-7, -6), (7, 6), (-7, 6), (7, -6), (0, 11))
STEPS = (4.0, 5.0)
LINES, PHOTOS_PER_LINE, NUM_POINTS = 6, 8, 1500


@dataclass(frozen=True)
class Flight:
    """``model`` in ENU as it is in truth, with noisy observations; ``places`` (N, 3) of the points
    in ``names``; ``marks`` with noise in all photos that see them."""

    model: pycolmap.Reconstruction
    names: list[str]
    places: np.ndarray
    marks: list[PhotoMark]

    def points(
        self,
        rng: np.random.Generator,
        *,
        sigma_m: float = 0.005,
        with_heights: bool = True,
        moved: dict[str, tuple[float, float, float]] | None = None,
    ) -> list[ControlPoint]:
        """As surveyed with these errors; some ``moved`` by metres east, north and up."""
        surveyed = self.places + rng.normal(0, sigma_m, self.places.shape)
        for name, shift in (moved or {}).items():
            surveyed[self.names.index(name)] += shift
        return [
            ControlPoint(
                name,
                GeoPosition(
                    latitude, longitude, altitude if with_heights else None, sigma_m, sigma_m
                ),
                marks=(),
                is_checkpoint=name.endswith("_check"),
            )
            for name, (latitude, longitude, altitude) in zip(
                self.names, FRAME.to_wgs84(surveyed), strict=True
            )
        ]


def make_flight(seed: int = 0) -> Flight:
    """Photos that look down in lines, over rolling ground."""
    rng = np.random.default_rng(seed)
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        camera_id=1,
        model="SIMPLE_RADIAL",
        width=WIDTH,
        height=HEIGHT,
        params=[FOCAL, WIDTH / 2, HEIGHT / 2, K1],
    )
    model.add_camera_with_trivial_rig(camera)
    down = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    spots = np.stack(
        np.meshgrid(np.arange(PHOTOS_PER_LINE) - 3.5, np.arange(LINES) - 2.5), axis=-1
    ).reshape(-1, 2) * np.array(STEPS)
    for image_id, (east, north) in enumerate(spots, start=1):
        tilt = pycolmap.Rotation3d(rng.normal(0, 0.03, 3)).matrix()
        centre = np.array([east, north, FLYING_HEIGHT_M]) + rng.normal(0, 0.3, 3)
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(tilt @ down), -tilt @ down @ centre)
        image = pycolmap.Image(name=f"{image_id:03}.jpg", camera_id=1, image_id=image_id)
        model.add_image_with_trivial_frame(image, pose)
    for xyz in on_ground(rng.uniform((-22, -20), (22, 20), (NUM_POINTS, 2))):
        seen = sightings_of(model, xyz, rng)
        if len(seen) < 2:
            continue
        track = pycolmap.Track()
        for image_id, xy in seen.items():
            model.image(image_id).points2D.append(pycolmap.Point2D(xy))
            track.add_element(image_id, len(model.image(image_id).points2D) - 1)
        model.add_point3D(xyz, track)
    model.update_point_3d_errors()
    places = on_ground(np.array(CONTROL + CHECKPOINTS, float))
    names = [f"gcp{i}" for i in range(len(CONTROL))]
    names += [f"{i}_check" for i in range(len(CHECKPOINTS))]
    marks = [
        PhotoMark(name, model.image(image_id).name, *xy)
        for name, xyz in zip(names, places, strict=True)
        for image_id, xy in sightings_of(model, xyz, rng).items()
    ]
    return Flight(model, names, places, marks)


def on_ground(spots: np.ndarray) -> np.ndarray:
    """(N, 2) → (N, 3)"""
    east, north = spots.T
    return np.column_stack([spots, np.sin(east / 5) + np.cos(north / 7)])


def sightings_of(
    model: pycolmap.Reconstruction, xyz: np.ndarray, rng: np.random.Generator
) -> dict[int, np.ndarray]:
    """Image id → pixel, with noise, where the point is in the photo."""
    seen = {}
    for image_id in model.reg_image_ids():
        xy = model.image(image_id).project_point(xyz)
        if xy is not None:
            xy = xy + rng.normal(0, NOISE_PX, 2)
            if 0 <= xy[0] <= WIDTH and 0 <= xy[1] <= HEIGHT:
                seen[image_id] = xy
    return seen


def bent(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """The model as it comes out if the lens is taken to have no distortion."""
    wrong = copy.deepcopy(model)
    camera = wrong.camera(1)
    camera.params = [*camera.params[:3], K1 / 2]
    adjustment = pycolmap.BundleAdjustmentOptions()
    adjustment.print_summary = False
    adjustment.refine_focal_length = adjustment.refine_extra_params = False
    adjust_all(wrong, adjustment)
    wrong.update_point_3d_errors()
    return wrong


def displaced(model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """The model in a frame of its own."""
    moved = copy.deepcopy(model)
    rotation = pycolmap.Rotation3d(np.array([0.4, -0.9, 1.3]))
    moved.transform(pycolmap.Sim3d(0.13, rotation, np.array([3.0, -1.0, 2.0])))
    return moved

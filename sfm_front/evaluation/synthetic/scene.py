"""Synthetic scenes with ground truth and features: a stream of photos without pixels."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pycolmap
from numpy.typing import NDArray

from sfm_front.errors import ConfigError
from sfm_front.evaluation.synthetic.world import World, fly_orbit, fly_ring, fly_strip
from sfm_front.types import (
    Exif,
    ExtractedPhoto,
    Features,
    Float32Array,
    Float64Array,
    GeoPosition,
    Uint8Array,
)

Layout = Literal["orbit", "strip", "ring"]

# A point's strength is the same in all photos, up to this standard deviation.
_STRENGTH_JITTER = 0.1
_DESCRIPTOR_NOISE = 16  # uniform, in units of a uint8 descriptor: a cosine of about 0.95
# SIFT histograms have few large entries, as has a gamma distribution of this shape.
_HISTOGRAM_SHAPE = 0.4


@dataclass(frozen=True, slots=True, eq=False)
class SyntheticPhoto:
    """What one photo sees. ``point_ids`` (N,) int64 is the scene point that each keypoint shows,
    -1 if it shows none or is misplaced."""

    name: str
    features: Features
    point_ids: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class SyntheticScene:
    """A flight over known points. Photos are made on demand, at a cost that depends on what a
    photo sees and not on the size of the scene; memory is about 200 bytes per scene point.

    ``camera`` took every photo, ``cams_from_world`` are the true poses, ``points`` (P, 3) float64
    the true points in metres, z up.
    """

    camera: pycolmap.Camera
    cams_from_world: tuple[pycolmap.Rigid3d, ...]
    seed: int
    noise_px: float
    outlier_ratio: float
    background_ratio: float
    repeatability: float
    _world: World
    _descriptors: Uint8Array
    _colors: Uint8Array

    @property
    def points(self) -> Float64Array:
        return self._world.points

    def __len__(self) -> int:
        return len(self.cams_from_world)

    def name(self, index: int) -> str:
        """The name of photo ``index``, counted from 0; names sort in flight order."""
        return f"{index:06d}.jpg"

    def photo(self, index: int) -> SyntheticPhoto:
        """Photo ``index``, counted from 0; the same at every call."""
        rng = np.random.default_rng([self.seed, 1, index])
        ids, pixels, strokes = self._world.project(self.camera, self.cams_from_world[index])
        detected = rng.random(len(ids)) < self.repeatability
        ids, pixels, strokes = ids[detected], pixels[detected], strokes[detected]
        pixels = pixels + rng.normal(0.0, self.noise_px, pixels.shape)
        shown = ids.copy()
        misplaced = rng.random(len(ids)) < self.outlier_ratio
        pixels[misplaced] = self._anywhere(rng, int(misplaced.sum()))
        shown[misplaced] = -1

        num_background = round(len(ids) * self.background_ratio / (1.0 - self.background_ratio))
        strength = np.concatenate(
            [
                self._world.strengths[ids] + _STRENGTH_JITTER * rng.normal(size=len(ids)),
                rng.random(num_background),
            ]
        )
        order = np.argsort(-strength)
        background = rng.normal(0.0, 4.0, (num_background, 2))
        strokes = np.concatenate([strokes, background])
        keypoints = np.column_stack(
            [
                np.concatenate([pixels, self._anywhere(rng, num_background)]),
                np.hypot(strokes[:, 0], strokes[:, 1]),
                np.arctan2(strokes[:, 1], strokes[:, 0]),
            ]
        )
        descriptors = np.concatenate(
            [_blurred(self._descriptors[ids], rng), _random_descriptors(num_background, rng)]
        )
        grey = np.full((num_background, 3), 128, dtype=np.uint8)
        features = Features(
            keypoints=keypoints[order].astype(np.float32),
            descriptors=descriptors[order],
            colors=np.concatenate([self._colors[ids], grey])[order],
        )
        shown = np.concatenate([shown, np.full(num_background, -1)])
        return SyntheticPhoto(self.name(index), features, shown[order])

    def truth(self) -> pycolmap.Reconstruction:
        """The true camera and poses as a model without points; image ids count from 1."""
        model = pycolmap.Reconstruction()
        model.add_camera_with_trivial_rig(self.camera)
        for index, cam_from_world in enumerate(self.cams_from_world):
            image = pycolmap.Image(
                name=self.name(index), camera_id=self.camera.camera_id, image_id=index + 1
            )
            model.add_image_with_trivial_frame(image, cam_from_world)
        return model

    def _anywhere(self, rng: np.random.Generator, count: int) -> Float64Array:
        return rng.random((count, 2)) * (self.camera.width, self.camera.height)


def make_scene(
    num_images: int,
    points_per_image: int = 1000,
    *,
    seed: int = 0,
    layout: Layout = "strip",
    noise_px: float = 0.5,
    outlier_ratio: float = 0.0,
    background_ratio: float = 0.3,
    repeatability: float = 0.8,
    lens: tuple[float, float, float] | None = None,
) -> SyntheticScene:
    """Plan a flight and scatter the points that it sees.

    ``points_per_image``: approximate number of scene points in a photo's view. "orbit" circles a
    lumpy ball, and every photo sees the side that faces it; "strip" flies parallel lines over
    hills, as a survey does, and the number of overlapping photos is bounded; "ring" flies one round
    over hills, and only its last photos see what its first ones saw. A point in view is detected
    with probability ``repeatability``, with noise of standard deviation ``noise_px`` along each
    axis. ``outlier_ratio`` of the detections are moved anywhere in the photo but keep their
    descriptor: they cause wrong matches. ``background_ratio`` of all keypoints show no scene
    point: they cause no matches. ``lens``: k1, p1, p2 of an OPENCV camera, not a SIMPLE_RADIAL one
    with a k of -0.03. Raises ConfigError if a value is out of range.
    """
    _check(num_images, points_per_image, noise_px, outlier_ratio, background_ratio, repeatability)
    rng = np.random.default_rng([seed, 0])
    camera = _camera(lens)
    if layout == "orbit":
        world, poses = fly_orbit(num_images, points_per_image, rng)
    elif layout == "strip":
        world, poses = fly_strip(num_images, points_per_image, camera, rng)
    elif layout == "ring":
        world, poses = fly_ring(num_images, points_per_image, camera, rng)
    else:
        raise ConfigError(f'layout must be "orbit", "strip" or "ring", got {layout!r}')
    return SyntheticScene(
        camera=camera,
        cams_from_world=poses,
        seed=seed,
        noise_px=noise_px,
        outlier_ratio=outlier_ratio,
        background_ratio=background_ratio,
        repeatability=repeatability,
        _world=world,
        _descriptors=_random_descriptors(len(world.points), rng),
        _colors=rng.integers(0, 256, (len(world.points), 3), dtype=np.uint8),
    )


def _camera(lens: tuple[float, float, float] | None) -> pycolmap.Camera:
    model, params = "SIMPLE_RADIAL", [1300.0, 800.0, 600.0, -0.03]
    if lens is not None:
        k1, p1, p2 = lens
        model, params = "OPENCV", [1300.0, 1300.0, 800.0, 600.0, k1, 0.0, p1, p2]
    return pycolmap.Camera(camera_id=1, model=model, width=1600, height=1200, params=params)


def as_described(
    photo: SyntheticPhoto,
    camera: pycolmap.Camera,
    global_vector: Float32Array,
    position: GeoPosition | None = None,
) -> ExtractedPhoto:
    """The photo as if taken by ``camera`` at ``position``, read from a file and extracted.

    ``global_vector`` (D,) float32.
    """
    return ExtractedPhoto(
        name=photo.name,
        path=Path(photo.name),
        width=camera.width,
        height=camera.height,
        digest=photo.name,
        exif=Exif(position=position),
        features=photo.features,
        global_vector=global_vector,
    )


def _check(
    num_images: int,
    points_per_image: int,
    noise_px: float,
    outlier_ratio: float,
    background_ratio: float,
    repeatability: float,
) -> None:
    if num_images < 1:
        raise ConfigError(f"num_images must be at least 1, got {num_images}")
    if points_per_image < 1:
        raise ConfigError(f"points_per_image must be at least 1, got {points_per_image}")
    if noise_px < 0:
        raise ConfigError(f"noise_px must not be negative, got {noise_px}")
    for name, share in (("outlier_ratio", outlier_ratio), ("background_ratio", background_ratio)):
        if not 0 <= share < 1:
            raise ConfigError(f"{name} must be at least 0 and below 1, got {share}")
    if not 0 < repeatability <= 1:
        raise ConfigError(f"repeatability must be above 0 and at most 1, got {repeatability}")


def _random_descriptors(count: int, rng: np.random.Generator) -> Uint8Array:
    """RootSIFT-like descriptors (N, 128): square roots of a histogram that sums to 1, times 512."""
    histograms = rng.standard_gamma(_HISTOGRAM_SHAPE, (count, 128), dtype=np.float32)
    histograms /= histograms.sum(axis=1, keepdims=True)
    return np.minimum(np.round(512.0 * np.sqrt(histograms)), 255).astype(np.uint8)


def _blurred(descriptors: Uint8Array, rng: np.random.Generator) -> Uint8Array:
    noise = rng.integers(
        -_DESCRIPTOR_NOISE, _DESCRIPTOR_NOISE, descriptors.shape, dtype=np.int16, endpoint=True
    )
    noise += descriptors
    return np.clip(noise, 0, 255).astype(np.uint8)

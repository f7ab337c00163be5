"""Photos of a scene with ground truth, rendered as if they had been taken through another lens."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pycolmap

from sfm_front.errors import ConfigError, InputError
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.exporters.undistortion import decoded, resampled, source_pixels
from sfm_front.photos.decoding import Undecodable
from sfm_front.photos.source import list_photos
from sfm_front.storage.colmap_models import read_model

_QUALITY = 97
# By how much the focal length grows at a time until no blank pixels are left.
_ZOOM_STEP = 1.005
# Places along each side where that is looked at.
_RIM = 65
_ROUNDING_PX = 1e-6


@dataclass(frozen=True, slots=True)
class Lens:
    """A COLMAP camera model and what follows focal lengths and principal point in its params."""

    model: str
    distortion: tuple[float, ...] = ()


PLAIN = "undistorted"

# r = θ + k1 θ³ for OPENCV_FISHEYE; tan θ, a plain lens, has k1 = 1/3.
LENSES = {
    PLAIN: Lens("PINHOLE"),
    "radial": Lens("OPENCV", (-0.1, 0.05, 0.0, 0.0)),
    "opencv": Lens("OPENCV", (-0.1, 0.02, 0.001, -0.0015)),
    "mild-fisheye": Lens("OPENCV_FISHEYE", (1 / 6, 0.0, 0.0, 0.0)),
    "strong-fisheye": Lens("OPENCV_FISHEYE", (0.0, 0.0, 0.0, 0.0)),
}
"""Lenses by name: none, a radial one, one that is off its axis as well, halfway to an equidistant
fisheye, and that."""


def check_lenses(names: list[str]) -> None:
    """Raises ConfigError for one that does not exist."""
    for name in names:
        if name not in LENSES:
            raise ConfigError(f"--lenses: no lens {name}; there are {', '.join(LENSES)}")


def through(lens: Lens, camera: pycolmap.Camera) -> pycolmap.Camera:
    """The camera with another lens: of the focal length nearest to its own at which a photo has no
    blank pixels, with the same id, size and principal point."""
    f_px = camera.mean_focal_length()
    principal_point = camera.principal_point_x, camera.principal_point_y
    while True:
        seen = pycolmap.Camera(
            camera_id=camera.camera_id,
            model=lens.model,
            width=camera.width,
            height=camera.height,
            params=[f_px, f_px, *principal_point, *lens.distortion],
        )
        if _sees_all(camera, seen):
            return seen
        f_px *= _ZOOM_STEP


def render(scene: BenchmarkScene, lens: Lens, folder: Path) -> BenchmarkScene:
    """The photos of the ground truth, through the lens, in ``folder/images``: the scene of these.

    The poses stay as they are, so does the ground truth. Photos have no EXIF: that would be of the
    other lens. Raises InputError where there is no ground truth or a photo is not of its size.
    """
    if scene.truth is None:
        raise InputError(f"{scene.photos}: no ground truth beside it; lenses need the true camera")
    truth = read_model(scene.truth)
    images = {truth.images[i].name.casefold(): truth.images[i] for i in truth.reg_image_ids()}
    seen = {i: through(lens, camera) for i, camera in truth.cameras.items()}
    maps = {i: source_pixels(truth.cameras[i], camera) for i, camera in seen.items()}
    photos = folder / "images"
    num_photos = 0
    for photo in list_photos(scene.photos):
        image = images.get(photo.name.casefold())
        if image is None:
            continue
        camera_id = image.camera_id
        pixels = decoded(photo.path.read_bytes(), truth.cameras[camera_id], seen[camera_id])
        if isinstance(pixels, (Undecodable, tuple)):
            raise InputError(f"{photo.path}: not a photo of the ground truth's camera: {pixels}")
        path = photos / photo.name
        path.parent.mkdir(parents=True, exist_ok=True)
        rendered = resampled(pixels, maps[camera_id])[..., ::-1]
        if not cv2.imwrite(str(path), rendered, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]):
            raise InputError(f"{path}: could not be written; give another --renders")
        num_photos += 1
    return replace(scene, photos=photos, num_photos=num_photos)


def _sees_all(camera: pycolmap.Camera, seen: pycolmap.Camera) -> bool:
    """Whether every pixel at the rim of ``seen`` lies between pixels of a photo of ``camera``."""
    size = np.array([camera.width, camera.height])
    x, y = (np.linspace(0.5, side - 0.5, _RIM) for side in (seen.width, seen.height))
    rim = np.concatenate(
        [np.column_stack([x, np.full(_RIM, at)]) for at in (y[0], y[-1])]
        + [np.column_stack([np.full(_RIM, at), y]) for at in (x[0], x[-1])]
    )
    directions = np.asarray(seen.cam_from_img(rim), np.float64)
    there = np.asarray(camera.img_from_cam(np.column_stack([directions, np.ones(len(rim))])))
    return bool(np.all(np.abs(there - size / 2) <= size / 2 - 0.5 + _ROUNDING_PX))

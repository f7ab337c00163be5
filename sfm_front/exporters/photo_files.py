"""Put a model's photos beside it, as a target can read them, and make the model fit them."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from io import BytesIO
from pathlib import Path, PurePosixPath

import numpy as np
import pycolmap
from PIL import Image

from sfm_front.errors import InputError
from sfm_front.exporters.flat_names import flat_stems
from sfm_front.exporters.scene import Job
from sfm_front.exporters.undistortion import (
    Projection,
    decoded,
    moved_points,
    resampled,
    source_pixels,
    takes_same_photos,
    target_camera,
)
from sfm_front.photos.decoding import Undecodable, decode
from sfm_front.photos.formats import EXTENSIONS, format_of
from sfm_front.runtime.thread_limits import limit_this_thread, single_threaded_calls
from sfm_front.types import Float32Array, Uint8Array

IMAGES = "images"
"""The folder of the photos in an export."""
NAMES = "names.csv"
"""Which photo is which, where names had to change."""

_JPEG = (".jpg", ".jpeg")
_JPEG_QUALITY = 95
_NUM_NAMED = 3
# Enough to tell whether a photo is whole and how large; a JPEG is decoded at an eighth for it.
_GLANCE_PX = 64


def place_photos(job: Job, projection: Projection) -> list[str]:
    """Write the photos of the job's model to ``images/``, under flat names.

    Each is copied or linked if it is already as ``projection`` and the options want it, else made
    anew: a JPEG as JPEG, anything else as PNG. The model then has these names, the cameras of
    these photos, and keypoints to match. Photos that are gone, damaged or of another size than
    their camera are left out of both. Returns what the user should know. Raises InputError if no
    photo is left, or a camera cannot be had in this projection, and OSError if the disk is full.
    """
    model = job.scene.model
    images = sorted(map(model.image, model.reg_image_ids()), key=lambda i: (i.camera_id, i.name))
    targets = {
        camera_id: target_camera(model.camera(camera_id), projection, job.options.max_size_px)
        for camera_id in sorted({image.camera_id for image in images})
    }
    if not any(_is_file(job.scene.photos.get(image.name)) for image in images):
        raise InputError(
            f"{images[0].name!r} and all other photos of the model are not where they were, or "
            "nobody knows where. Give the folder that holds them with --images."
        )
    outcomes = _make_all(job, images, targets)
    made = {image_id: file for image_id, file in outcomes.items() if isinstance(file, Path)}
    left_out = {
        model.image(image_id).name: why
        for image_id, why in outcomes.items()
        if isinstance(why, str)
    }
    _leave_out(model, made)
    names = {model.image(i).name: made[i].name for i in model.reg_image_ids()}
    _move_cameras(model, targets)
    for image_id in model.reg_image_ids():
        model.image(image_id).name = made[image_id].name
    return [*_about_left_out(left_out), *_about_names(job, names)]


def _make_all(
    job: Job, images: list[pycolmap.Image], targets: Mapping[int, pycolmap.Camera]
) -> dict[int, Path | str]:
    """Image id → the photo's new file, or why there is none."""
    (job.folder / IMAGES).mkdir()
    maker = _PhotoMaker(job, targets, flat_stems(sorted(image.name for image in images)))
    outcomes: dict[int, Path | str] = {}
    threads = job.options.threads
    with single_threaded_calls(opencv=True):
        pool = ThreadPoolExecutor(threads, "sfm-photos", limit_this_thread)
        try:
            for image, outcome in zip(images, pool.map(maker.make, images), strict=True):
                outcomes[image.image_id] = outcome
                job.on_progress(len(outcomes), len(images))
        finally:
            pool.shutdown(cancel_futures=True)
    return outcomes


class _PhotoMaker:
    """Makes one photo after the other, on several threads."""

    def __init__(
        self, job: Job, targets: Mapping[int, pycolmap.Camera], stems: Mapping[str, str]
    ) -> None:
        self._job = job
        self._cameras = {camera_id: job.scene.model.camera(camera_id) for camera_id in targets}
        self._targets = targets
        self._stems = stems
        # Photos come by camera: those in work have few between them.
        self._source_pixels = lru_cache(maxsize=job.options.threads)(self._find_source_pixels)

    def make(self, image: pycolmap.Image) -> Path | str:
        """The new file, or why there is none."""
        path = self._job.scene.photos.get(image.name)
        if path is None or not _is_file(path):
            return "not found"
        try:
            data = path.read_bytes()
        except OSError as error:
            return f"cannot be read: {error.strerror}"
        camera, target = self._cameras[image.camera_id], self._targets[image.camera_id]
        file = self._job.folder / IMAGES / self._stems[image.name]
        if takes_same_photos(camera, target):
            return self._hand_on(path, data, camera, file.with_suffix(_suffix(image.name, data)))
        pixels = decoded(data, camera, target)
        if isinstance(pixels, Undecodable):
            return _why(pixels)
        if isinstance(pixels, tuple):
            return _of_another_size(pixels, camera)
        pixels = resampled(pixels, self._source_pixels(image.camera_id))
        suffix = _suffix(image.name, data)
        is_jpeg = suffix.lower() in _JPEG
        file = file.with_suffix(suffix if is_jpeg else ".png")
        file.write_bytes(_encoded(pixels, is_jpeg))
        return file

    def _hand_on(self, path: Path, data: bytes, camera: pycolmap.Camera, file: Path) -> Path | str:
        photo = decode(data, _GLANCE_PX)
        if isinstance(photo, Undecodable):
            return _why(photo)
        if (photo.width, photo.height) != (camera.width, camera.height):
            return _of_another_size((photo.width, photo.height), camera)
        if self._job.options.link:
            file.symlink_to(path.absolute())
        else:
            file.write_bytes(data)
        return file

    def _find_source_pixels(self, camera_id: int) -> Float32Array:
        return source_pixels(self._cameras[camera_id], self._targets[camera_id])


def _suffix(name: str, data: bytes) -> str:
    """That of the name if it is a photo's, else that of the content."""
    suffix = PurePosixPath(name).suffix
    if suffix.lower() in EXTENSIONS:
        return suffix
    image_format = format_of(data)
    return "" if image_format is None else f".{image_format.name.lower()}"


def _is_file(path: Path | None) -> bool:
    try:
        return path is not None and path.is_file()
    except (OSError, ValueError):
        return False


def _why(photo: Undecodable) -> str:
    return f"{photo.reason.value}: {photo.detail}" if photo.detail else photo.reason.value


def _of_another_size(size: tuple[int, int], camera: pycolmap.Camera) -> str:
    return f"is {size[0]} x {size[1]} now, was {camera.width} x {camera.height}"


def _encoded(pixels: Uint8Array, is_jpeg: bool) -> bytes:
    buffer = BytesIO()
    if is_jpeg:
        # Full resolution of colours: the photo was compressed once already.
        Image.fromarray(pixels).save(buffer, "JPEG", quality=_JPEG_QUALITY, subsampling=0)
    else:
        Image.fromarray(pixels).save(buffer, "PNG", compress_level=4)
    return buffer.getvalue()


def _leave_out(model: pycolmap.Reconstruction, made: Mapping[int, Path]) -> None:
    """Take images without a photo out of the model, and then photos without an image."""
    for image_id in set(model.reg_image_ids()) - set(made):
        if image_id in set(model.reg_image_ids()):  # Not with another one of its frame.
            model.deregister_frame(model.image(image_id).frame_id)
    kept = set(model.reg_image_ids())
    if not kept:
        raise InputError(
            "none of the photos can be read, or all have another size now. Give the folder of "
            "those that were reconstructed with --images."
        )
    for image_id, file in made.items():
        if image_id not in kept:
            file.unlink()


def _move_cameras(model: pycolmap.Reconstruction, targets: Mapping[int, pycolmap.Camera]) -> None:
    """Give the model the target's cameras, and its keypoints their places in these."""
    for image_id in model.reg_image_ids():
        image = model.image(image_id)
        camera, target = model.camera(image.camera_id), targets[image.camera_id]
        if takes_same_photos(camera, target):
            continue
        points = np.array([point.xy for point in image.points2D]).reshape(-1, 2)
        for index, xy in enumerate(moved_points(points, camera, target)):
            if np.isfinite(xy).all():
                image.points2D[index].xy = xy
                continue
            # Beyond the edge of a lens's model; no reader takes nan.
            if image.points2D[index].has_point3D():
                model.delete_observation(image_id, index)
            image.points2D[index].xy = np.zeros(2)
    # Cameras whose photos are elsewhere too: readers stop at any that they do not know.
    some_target = next(iter(targets.values()))
    for camera_id, camera in model.cameras.items():
        target = targets.get(camera_id, some_target)
        camera.model = target.model
        camera.width, camera.height = target.width, target.height
        camera.params = list(target.params)


def _about_left_out(left_out: Mapping[str, str]) -> list[str]:
    if not left_out:
        return []
    named = ", ".join(f"{name!r} ({why})" for name, why in list(left_out.items())[:_NUM_NAMED])
    more = f" and {len(left_out) - _NUM_NAMED} more" if len(left_out) > _NUM_NAMED else ""
    return [f"{len(left_out)} left out: {named}{more}"]


def _about_names(job: Job, names: Mapping[str, str]) -> list[str]:
    renamed = sum(old != new for old, new in names.items())
    if not renamed:
        return []
    with (job.folder / NAMES).open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(["file", "photo"])
        table.writerows(sorted((new, old) for old, new in names.items()))
    return [f"{renamed} renamed, because readers stumble over such names: see {NAMES}"]

"""A model with exact keypoints, photos on disk, and a session's folder around them, for tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pycolmap
from PIL import Image

from helpers.model_building import looking
from sfm_front.exporters.options import ExportOptions
from sfm_front.exporters.scene import Job, Scene

WIDTH, HEIGHT = 200, 150
# Parameters of lenses with visible distortion; the principal point of some is off the middle.
LENSES = {
    "SIMPLE_PINHOLE": [180, 100, 75],
    "PINHOLE": [180, 182, 96, 78],
    "SIMPLE_RADIAL": [180, 100, 75, -0.1],
    "RADIAL": [180, 100, 75, -0.1, 0.02],
    "OPENCV": [180, 182, 96, 78, -0.1, 0.02, 0.001, -0.002],
    "OPENCV_FISHEYE": [150, 151, 101, 74, 0.02, -0.01, 0.001, 0.0],
    "FULL_OPENCV": [180, 182, 96, 78, -0.1, 0.02, 0.001, -0.002, 0.001, 0.01, 0.002, 0.0],
}
PLAIN = ("a.png", "b.png", "c.png")


def camera(lens: str, camera_id: int = 1) -> pycolmap.Camera:
    return pycolmap.Camera(
        camera_id=camera_id, model=lens, width=WIDTH, height=HEIGHT, params=LENSES[lens]
    )


def exact_model(
    lenses: Sequence[str] = ("SIMPLE_RADIAL",), names: Sequence[str] = PLAIN
) -> pycolmap.Reconstruction:
    """Photos that walk past a cloud of points, the lenses in turn; keypoints where they project.

    Each photo also has a keypoint that belongs to no point, first in its list.
    """
    rng = np.random.default_rng(0)
    model = pycolmap.Reconstruction()
    for camera_id, lens in enumerate(lenses, start=1):
        model.add_camera_with_trivial_rig(camera(lens, camera_id))
    points = rng.uniform([-1.5, 4, -1], [3, 6, 1], (60, 3))
    seen: list[list[tuple[int, int]]] = [[] for _ in points]
    for index, name in enumerate(names):
        camera_id = 1 + index % len(lenses)
        pose = looking([index, 0, 0.1 * index], [0.1 - 0.2 * index, 1, 0.05], [0.1, 0, 1])
        pixels = model.camera(camera_id).img_from_cam(pose * points)
        inside = np.all((pixels > 1) & (pixels < [WIDTH - 1, HEIGHT - 1]), axis=1)
        for place, point in enumerate(np.flatnonzero(inside), start=1):
            seen[point].append((index + 1, place))
        image = pycolmap.Image(
            name=name,
            keypoints=np.vstack([[[10.5, 20.5]], pixels[inside]]),
            camera_id=camera_id,
            image_id=index + 1,
        )
        model.add_image_with_trivial_frame(image, pose)
    for xyz, observations in zip(points, seen, strict=True):
        if len(observations) > 1:
            elements = [pycolmap.TrackElement(*observation) for observation in observations]
            model.add_point3D(xyz, pycolmap.Track(elements), rng.integers(0, 256, 3, np.uint8))
    return model


def write_photos(folder: Path, names: Sequence[str] = PLAIN) -> dict[str, Path]:
    """Smooth pictures of the cameras' size; name → path."""
    paths = {name: folder / f"{index}_{Path(name).name}" for index, name in enumerate(names)}
    folder.mkdir(parents=True, exist_ok=True)
    for index, path in enumerate(paths.values()):
        smooth_picture(index).save(path)
    return paths


def smooth_picture(seed: int = 0) -> Image.Image:
    x, y = np.meshgrid(np.arange(WIDTH) / WIDTH, np.arange(HEIGHT) / HEIGHT)
    waves = [127 + 120 * np.sin(6 * x + 5 * y * (c + 1) + seed + c) for c in range(3)]
    return Image.fromarray(np.stack(waves, axis=-1).astype(np.uint8))


def job_of(
    folder: Path, model: pycolmap.Reconstruction, photos: dict[str, Path], **options: object
) -> Job:
    """A job that writes to ``folder / "export"``, which is made."""
    (folder / "export").mkdir()
    scene = Scene(model, photos, {}, None)
    return Job(scene, folder / "export", ExportOptions(**options), lambda _done, _total: None)


def model_folder(folder: Path, model: pycolmap.Reconstruction, number: int = 0) -> Path:
    """Write a model to ``folder/sparse/NUMBER``, as a session does."""
    place = folder / "sparse" / str(number)
    place.mkdir(parents=True)
    model.write_binary(place)
    return place

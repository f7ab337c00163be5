"""Models whose photos were taken through lenses that the models do not have, for tests."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
import pycolmap

FOCAL_PX, WIDTH, HEIGHT = 800.0, 1024, 768
MIDDLE = (WIDTH / 2, HEIGHT / 2)


def camera_of(lens: str, distortion: Sequence[float] = (), camera_id: int = 1) -> pycolmap.Camera:
    """A camera with this lens; its principal point is the middle."""
    focal = [FOCAL_PX, FOCAL_PX] if lens in ("OPENCV", "PINHOLE") else [FOCAL_PX]
    return pycolmap.Camera(
        camera_id=camera_id,
        model=lens,
        width=WIDTH,
        height=HEIGHT,
        params=[*focal, *MIDDLE, *distortion],
    )


def true_model(
    *cameras: pycolmap.Camera,
    num_photos: int = 12,
    tilt_deg: float = 20.0,
    relief: float = 2.0,
    noise_px: float = 0.3,
    seed: int = 0,
) -> pycolmap.Reconstruction:
    """Photos on a grid over points that fill them, by these cameras in turn.

    They are tilted by turns to all sides; points lie 8 below, up to ``relief`` higher or lower.
    Keypoints have noise of this standard deviation.
    """
    rng = np.random.default_rng(seed)
    model = pycolmap.Reconstruction()
    for camera in cameras:
        model.add_camera_with_trivial_rig(copy.copy(camera))
    places = np.column_stack([rng.uniform(-9, 12, (900, 2)), 8 + rng.uniform(-1, 1, 900) * relief])
    tracks: list[list[tuple[int, int]]] = [[] for _ in places]
    for number in range(num_photos):
        camera = cameras[number % len(cameras)]
        way = number * np.pi / 2
        turn = pycolmap.Rotation3d(np.radians(tilt_deg) * np.array([np.cos(way), np.sin(way), 0]))
        centre = np.array([number % 4, number // 4, 0.0])
        pose = pycolmap.Rigid3d(turn, -turn.matrix() @ centre)
        seen = places @ pose.rotation.matrix().T + pose.translation
        pixels = np.asarray(camera.img_from_cam(seen))
        inside = np.all((pixels > 0) & (pixels < (WIDTH, HEIGHT)), axis=1)
        # Distortion may bring back what lies far outside.
        inside &= np.all(np.abs(seen[:, :2] / seen[:, 2:]) < 0.9, axis=1)
        indices = np.flatnonzero(inside)
        keypoints = pixels[indices] + rng.normal(0, noise_px, (len(indices), 2))
        image = pycolmap.Image(
            name=f"{number:03d}",
            keypoints=keypoints,
            camera_id=camera.camera_id,
            image_id=number + 1,
        )
        model.add_image_with_trivial_frame(image, pose)
        for place, index in enumerate(indices):
            tracks[index].append((number + 1, place))
    for xyz, elements in zip(places, tracks, strict=True):
        if len(elements) >= 3:
            track = pycolmap.Track()
            for element in elements:
                track.add_element(*element)
            model.add_point3D(xyz, track)
    model.update_point_3d_errors()
    return model


def as_mapped(
    model: pycolmap.Reconstruction, lens: str = "SIMPLE_RADIAL"
) -> pycolmap.Reconstruction:
    """The model as mapping leaves it: adjusted with a simple lens."""
    mapped = copy.deepcopy(model)
    for camera in mapped.cameras.values():
        simple = pycolmap.Camera.create_from_model_name(1, lens, FOCAL_PX, WIDTH, HEIGHT)
        camera.model = simple.model
        camera.params = simple.params.tolist()
    pycolmap.bundle_adjustment(mapped, pycolmap.BundleAdjustmentOptions(print_summary=False))
    mapped.update_point_3d_errors()
    return mapped

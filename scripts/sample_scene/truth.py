"""The true model of the flight: camera, poses, and surface points with their tracks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import open3d as o3d
import pycolmap
from numpy.typing import NDArray

from .noise import Floats
from .render import Stage

_VISIBLE_WITHIN = 2e-3  # largest distance of a ray's hit from its point, as a fraction of the depth


def true_model(
    stage: Stage,
    camera: pycolmap.Camera,
    poses: Sequence[pycolmap.Rigid3d],
    names: Sequence[str],
    pictures: Sequence[Floats],
    *,
    num_points: int,
    seed: int,
) -> pycolmap.Reconstruction:
    """A COLMAP model in metres, x east, y north, z up; every photo in view of a point observes it.

    The points are where rays through random pixels of the photos hit.
    """
    rng = np.random.default_rng(seed)
    xyz = _surface_points(stage, camera, poses, num_points, rng)
    tracks = [pycolmap.Track() for _ in xyz]
    colours: list[NDArray[np.float32]] = [np.zeros(3, dtype=np.float32) for _ in xyz]
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(camera)
    for image_id, (name, pose, picture) in enumerate(zip(names, poses, pictures, strict=True), 1):
        seen, pixels = _visible(stage, camera, pose, xyz)
        image = pycolmap.Image(
            name=name, keypoints=pixels, camera_id=camera.camera_id, image_id=image_id
        )
        model.add_image_with_trivial_frame(image, pose)
        for index, (point, (x, y)) in enumerate(zip(seen, pixels, strict=True)):
            tracks[point].add_element(image_id, index)
            colours[point] = picture[int(y), int(x)]
    for position, track, colour in zip(xyz, tracks, colours, strict=True):
        if track.length() >= 2:
            model.add_point3D(position, track, np.round(255.0 * colour).astype(np.uint8))
    model.update_point_3d_errors()
    return model


def _surface_points(
    stage: Stage,
    camera: pycolmap.Camera,
    poses: Sequence[pycolmap.Rigid3d],
    count: int,
    rng: np.random.Generator,
) -> NDArray[np.float64]:
    size = np.array([camera.width, camera.height])
    found = []
    for share, pose in zip(np.array_split(np.arange(count), len(poses)), poses, strict=True):
        pixels = rng.random((len(share), 2)) * size
        depth, centre, directions = _cast(stage, camera, pose, pixels)
        hit = np.isfinite(depth)
        found.append(centre + depth[hit, None] * directions[hit])
    return np.concatenate(found)


def _visible(
    stage: Stage,
    camera: pycolmap.Camera,
    cam_from_world: pycolmap.Rigid3d,
    xyz: NDArray[np.float64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The points a photo sees, and their pixels (N, 2)."""
    in_camera = cam_from_world * xyz
    # Distortion may map points far outside the picture back into it.
    ahead = in_camera[:, 2] > np.hypot(in_camera[:, 0], in_camera[:, 1])
    candidates = np.flatnonzero(ahead)
    pixels = np.asarray(camera.img_from_cam(in_camera[candidates]))
    size = np.array([camera.width, camera.height])
    inside = ((pixels >= 0) & (pixels < size)).all(axis=1)
    candidates, pixels = candidates[inside], pixels[inside]
    depth, _, _ = _cast(stage, camera, cam_from_world, pixels)
    expected = in_camera[candidates, 2]
    unhidden = np.abs(depth - expected) < _VISIBLE_WITHIN * expected
    return candidates[unhidden], pixels[unhidden]


def _cast(
    stage: Stage,
    camera: pycolmap.Camera,
    cam_from_world: pycolmap.Rigid3d,
    pixels: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Depth along z (N,), the camera's centre (3,), and directions (N, 3) of unit depth."""
    rotation = cam_from_world.rotation.matrix()
    centre = -rotation.T @ cam_from_world.translation
    in_camera = np.column_stack([np.asarray(camera.cam_from_img(pixels)), np.ones(len(pixels))])
    directions = in_camera @ rotation
    rays = np.hstack([np.broadcast_to(centre, directions.shape), directions])
    hits = stage.caster.cast_rays(o3d.core.Tensor.from_numpy(rays.astype(np.float32)))
    return hits["t_hit"].numpy().astype(np.float64), centre, directions

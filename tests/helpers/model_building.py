"""COLMAP models made by hand, for tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pycolmap

WIDTH, HEIGHT, FOCAL = 640, 480, 500.0


def looking(centre: Sequence[float], towards: Sequence[float], up: Sequence[float]):
    """cam_from_world of a camera at ``centre`` that looks in the direction ``towards``."""
    forward = np.array(towards, float) / np.linalg.norm(towards)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(forward, right), forward])
    return pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ np.array(centre, float))


def make_model(
    cams_from_world: Mapping[str, pycolmap.Rigid3d],
    points: np.ndarray | None = None,
    colors: np.ndarray | None = None,
) -> pycolmap.Reconstruction:
    """A model of the named photos in order, with one camera; its points have no observations."""
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        camera_id=1,
        model="SIMPLE_PINHOLE",
        width=WIDTH,
        height=HEIGHT,
        params=[FOCAL, WIDTH / 2, HEIGHT / 2],
    )
    model.add_camera_with_trivial_rig(camera)
    for image_id, (name, cam_from_world) in enumerate(cams_from_world.items(), start=1):
        image = pycolmap.Image(name=name, camera_id=1, image_id=image_id)
        model.add_image_with_trivial_frame(image, cam_from_world)
    if points is not None:
        colors = np.full(points.shape, 128) if colors is None else colors
        for xyz, color in zip(points, colors, strict=True):
            model.add_point3D(xyz, pycolmap.Track(), color.astype(np.uint8))
    return model


def model_of(seen_by: Sequence[Sequence[str]]) -> pycolmap.Reconstruction:
    """A model with one point for each of ``seen_by``, the names of the photos that observe it."""
    names = sorted({name for photo in seen_by for name in photo})
    cameras = {name: looking([i, 0, 0], [0, 1, 0], [0, 0, 1]) for i, name in enumerate(names)}
    model = make_model(cameras)
    ids = {image.name: image.image_id for image in model.images.values()}
    for name, image_id in ids.items():
        here = [i for i, photo in enumerate(seen_by) if name in photo]
        model.images[image_id].points2D = [pycolmap.Point2D([5.0, 5.0]) for _ in here]
    places = dict.fromkeys(names, 0)
    for point in seen_by:
        track = pycolmap.Track()
        for name in point:
            track.add_element(ids[name], places[name])
            places[name] += 1
        model.add_point3D(np.zeros(3), track, np.zeros(3, np.uint8))
    return model

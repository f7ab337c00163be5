"""One model put into another: photos, points and cameras, once the similarity is known."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pycolmap

from sfm_front.geometry.rays import undistorted_rays
from sfm_front.mapping.bundle_adjustment import adjust_all
from sfm_front.mapping.mapper_options import MapperOptions

# Cameras whose pixels lie nearer to each other than this, in the median, are the same.
_SAME_CAMERA_PX = 1.0
# Pixels along each side at which cameras are compared.
_GRID = 8


def with_cameras_of(
    model: pycolmap.Reconstruction, other: pycolmap.Reconstruction, options: MapperOptions
) -> pycolmap.Reconstruction:
    """The model adjusted with the intrinsics that another one gives to the cameras of both, or the
    one given if they hardly differ.

    Models with different intrinsics bend space differently: no similarity leads from one to the
    other.
    """
    shared = sorted(_used_cameras(model) & _used_cameras(other))
    if all(_shift_px(model.camera(i), other.camera(i)) < _SAME_CAMERA_PX for i in shared):
        return model
    adjusted = copy.deepcopy(model)
    for camera_id in shared:
        adjusted.camera(camera_id).params = other.camera(camera_id).params.tolist()
    held = replace(options, refine_intrinsics=False).streaming()
    adjust_all(adjusted, held.get_global_bundle_adjustment())
    return adjusted


def merged(
    first: pycolmap.Reconstruction,
    second: pycolmap.Reconstruction,
    first_from_second: pycolmap.Sim3d,
    same_points: Iterable[tuple[int, int]],
) -> pycolmap.Reconstruction:
    """A copy of the first model with what it lacks of the second.

    Photos of both stay where the first has them. ``same_points``: a point of either that are one.
    Both models are over the same view graph: their image, camera and keypoint ids agree.
    """
    model = copy.deepcopy(first)
    for camera_id in _used_cameras(second) - _used_cameras(first):
        model.camera(camera_id).params = second.camera(camera_id).params.tolist()
    for image_id in second.reg_image_ids():
        if not model.image(image_id).has_pose:
            pose = second.image(image_id).cam_from_world()
            frame_id = model.image(image_id).frame_id
            moved = first_from_second.transform_camera_world(pose)
            model.frame(frame_id).rig_from_world = moved  # a frame's only image is its camera
            model.register_frame(frame_id)
    partners = {in_second: in_first for in_first, in_second in same_points}
    taken = _observed(first, set(first.reg_image_ids()) & set(second.reg_image_ids()))
    for point_id in sorted(second.point3D_ids()):
        point = second.point3D(point_id)
        elements = point.track.elements
        free = [e for e in elements if (e.image_id, e.point2D_idx) not in taken]
        held = [taken[e.image_id, e.point2D_idx] for e in elements if e not in free]
        partner = partners.get(point_id, held[0] if held else None)
        if partner is not None:
            _add_observations(model, partner, free)
        elif len(free) > 1:
            track = pycolmap.Track()
            track.add_elements(free)
            model.add_point3D(first_from_second * point.xyz, track, point.color)
    return model


def _observed(
    model: pycolmap.Reconstruction, image_ids: Iterable[int]
) -> dict[tuple[int, int], int]:
    """Image id and keypoint index → the point that it observes, for these photos."""
    return {
        (image_id, index): image.point2D(index).point3D_id
        for image_id in image_ids
        for image in [model.image(image_id)]
        for index in image.get_observation_point2D_idxs()
    }


def _add_observations(
    model: pycolmap.Reconstruction, point_id: int, elements: Iterable[pycolmap.TrackElement]
) -> None:
    """A photo that observes the point already keeps the keypoint by which it does."""
    seen_by = {element.image_id for element in model.point3D(point_id).track.elements}
    for element in elements:
        if element.image_id not in seen_by:
            seen_by.add(element.image_id)
            model.add_observation(point_id, element)


def _used_cameras(model: pycolmap.Reconstruction) -> set[int]:
    return {int(model.image(i).camera_id) for i in model.reg_image_ids()}


def _shift_px(camera: pycolmap.Camera, other: pycolmap.Camera) -> float:
    """Median distance between where either has what the other sees, over the whole picture."""
    across, down = (
        (np.arange(_GRID) + 0.5) * side / _GRID for side in (camera.width, camera.height)
    )
    pixels = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    moved = np.asarray(other.img_from_cam(undistorted_rays(camera, pixels)))
    return float(np.median(np.linalg.norm(moved - pixels, axis=1)))

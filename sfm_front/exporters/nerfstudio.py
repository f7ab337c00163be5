"""A scene as nerfstudio reads it: ``transforms.json``, photos and points.

Conventions: docs.nerf.studio/quickstart/data_conventions.html and nerfstudio's
``nerfstudio_dataparser.py``.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pycolmap

from sfm_front.exporters.colmap import POINT_CLOUD
from sfm_front.exporters.photo_files import IMAGES, place_photos
from sfm_front.exporters.ply import write_point_cloud
from sfm_front.exporters.scene import Job
from sfm_front.exporters.undistortion import Projection

TRANSFORMS = "transforms.json"

# COLMAP's models → the coefficients that follow focal length and principal point.
_PERSPECTIVE: dict[str, tuple[str, ...]] = {
    "SIMPLE_PINHOLE": (),
    "PINHOLE": (),
    "SIMPLE_RADIAL": ("k1",),
    "RADIAL": ("k1", "k2"),
    "OPENCV": ("k1", "k2", "p1", "p2"),
}
_FISHEYE: dict[str, tuple[str, ...]] = {
    "SIMPLE_RADIAL_FISHEYE": ("k1",),
    "RADIAL_FISHEYE": ("k1", "k2"),
    "OPENCV_FISHEYE": ("k1", "k2", "k3", "k4"),
}
_FAMILIES = (
    ("OPENCV", _PERSPECTIVE, ("k1", "k2", "p1", "p2")),
    ("OPENCV_FISHEYE", _FISHEYE, ("k1", "k2", "k3", "k4")),
)
# OpenGL's camera looks along -z with y up.
_COLMAP_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


def write(job: Job) -> list[str]:
    """``transforms.json``: poses camera-to-world with OpenGL's axes, in the model's world, and
    ``applied_transform`` the identity; ``points3D.ply`` in the same world; ``images/``.

    Photos keep their distortion if all cameras are OpenCV's perspective model or a simpler one, or
    all its fisheye model: nerfstudio has one type of camera for all. Else they are undistorted. A
    world that is east, north and up stays upright: ``orientation_override``.
    """
    model = job.scene.model
    used = {model.image(i).camera_id for i in model.reg_image_ids()}
    models = {model.camera(camera_id).model_name for camera_id in used}
    family = next((family for family in _FAMILIES if models <= set(family[1])), None)
    notes = place_photos(job, Projection.AS_TAKEN if family else Projection.PINHOLE)
    camera_model, known, coefficients = family or ("PINHOLE", _PERSPECTIVE, ())
    intrinsics = {
        camera_id: _intrinsics(model.camera(camera_id), known, coefficients)
        for camera_id in sorted({model.image(i).camera_id for i in model.reg_image_ids()})
    }
    shared = next(iter(intrinsics.values())) if len(intrinsics) == 1 else {}
    frames = [
        {
            "file_path": f"{IMAGES}/{image.name}",
            "transform_matrix": _transform(image),
            **({} if shared else intrinsics[image.camera_id]),
        }
        for image in sorted(map(model.image, model.reg_image_ids()), key=lambda i: str(i.name))
    ]
    content = {
        "camera_model": camera_model,
        **shared,
        "applied_transform": np.eye(4)[:3].tolist(),
        "ply_file_path": POINT_CLOUD,
        **({} if job.scene.frame is None else {"orientation_override": "none"}),
        "frames": frames,
    }
    (job.folder / TRANSFORMS).write_text(
        json.dumps(content, ensure_ascii=False, indent=1) + "\n", encoding="utf-8"
    )
    write_point_cloud(model, job.folder / POINT_CLOUD)
    return notes


def _intrinsics(
    camera: pycolmap.Camera, known: dict[str, tuple[str, ...]], coefficients: tuple[str, ...]
) -> dict[str, Any]:
    own = known[camera.model_name]
    values = (
        dict(zip(own, (float(p) for p in camera.params[-len(own) :]), strict=True)) if own else {}
    )
    return {
        "fl_x": float(camera.focal_length_x),
        "fl_y": float(camera.focal_length_y),
        "cx": float(camera.principal_point_x),
        "cy": float(camera.principal_point_y),
        "w": int(camera.width),
        "h": int(camera.height),
        **{name: values.get(name, 0.0) for name in coefficients},
    }


def _transform(image: pycolmap.Image) -> list[list[float]]:
    """(4, 4) world from camera, the camera's axes being OpenGL's."""
    world_from_cam = np.eye(4)
    world_from_cam[:3] = image.cam_from_world().inverse().matrix()
    transform: list[list[float]] = (world_from_cam @ _COLMAP_FROM_OPENGL).tolist()
    return transform

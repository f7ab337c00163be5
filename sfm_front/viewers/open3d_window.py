"""Show a scene in an Open3D window."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from sfm_front.errors import DependencyError
from sfm_front.viewers.model_drawing import Scene
from sfm_front.viewers.open3d_loader import load_open3d
from sfm_front.viewers.options import BACKGROUNDS, DrawOptions
from sfm_front.viewers.viewpoint import VERTICAL_FIELD_OF_VIEW_DEG, View


def show(scene: Scene, options: DrawOptions, title: str) -> None:
    """Open a window and return when it is closed.

    Raises ``DependencyError`` if Open3D cannot load or there is no screen.
    """
    # Without a screen, Open3D would open an invisible window and wait for it to be closed.
    if not _has_screen():
        raise DependencyError("no screen to open a window on; use --screenshot FILE.png instead")
    o3d = load_open3d()
    window = o3d.visualization.VisualizerWithKeyCallback()
    title = f"{title} (C: cameras on and off, + and -: size of points, H: all keys)"
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        opened = window.create_window(title, width=options.width, height=options.height)
    if not opened:
        raise DependencyError("open3d cannot open a window; use --screenshot FILE.png instead")
    try:
        points, cameras = _points(o3d, scene), _cameras(o3d, scene)
        for geometry in (points, cameras):
            if geometry is not None:
                window.add_geometry(geometry)
        if cameras is not None:
            window.register_key_callback(ord("C"), _toggle(cameras))
        drawing = window.get_render_option()
        drawing.background_color = np.array(BACKGROUNDS[options.background][0])
        drawing.point_size = scene.point_size_px
        window.get_view_control().convert_from_pinhole_camera_parameters(
            _pinhole(o3d, scene.view, options), allow_arbitrary=True
        )
        window.run()
    finally:
        window.destroy_window()


def _has_screen() -> bool:
    """Whether a window can be opened; on Linux, whether there is a Wayland or X server."""
    if not sys.platform.startswith("linux") or os.environ.get("WAYLAND_DISPLAY"):
        return True
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return True  # Open3D needs this library too, and names it when it fails to load
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        return False
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return True


def _points(o3d: Any, scene: Scene) -> Any:
    """None without any."""
    if not len(scene.points):
        return None
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(scene.points))
    cloud.colors = o3d.utility.Vector3dVector(scene.point_colors)
    return cloud


def _cameras(o3d: Any, scene: Scene) -> Any:
    """Frusta and path; None without any."""
    if not len(scene.lines):
        return None
    lines = o3d.geometry.LineSet(
        o3d.utility.Vector3dVector(scene.vertices), o3d.utility.Vector2iVector(scene.lines)
    )
    lines.colors = o3d.utility.Vector3dVector(scene.line_colors)
    return lines


def _toggle(geometry: Any) -> Callable[[Any], bool]:
    """For a key: takes a geometry that is shown out of a window, and back into it."""
    is_shown = True

    def act(window: Any) -> bool:
        nonlocal is_shown
        change = window.remove_geometry if is_shown else window.add_geometry
        change(geometry, reset_bounding_box=False)
        is_shown = not is_shown
        return True

    return act


def _pinhole(o3d: Any, view: View, options: DrawOptions) -> Any:
    """The view as Open3D's pinhole camera; its extrinsic is 4 x 4, camera from world."""
    focal = 0.5 * options.height / np.tan(np.radians(VERTICAL_FIELD_OF_VIEW_DEG) / 2)
    forward = (view.target - view.eye) / np.linalg.norm(view.target - view.eye)
    right = np.cross(forward, view.up)
    cam_from_world = np.eye(4)
    cam_from_world[:3, :3] = [right, np.cross(forward, right), forward]
    cam_from_world[:3, 3] = -cam_from_world[:3, :3] @ view.eye
    parameters = o3d.camera.PinholeCameraParameters()
    # The legacy viewer accepts only this principal point.
    parameters.intrinsic = o3d.camera.PinholeCameraIntrinsic(
        options.width,
        options.height,
        focal,
        focal,
        options.width / 2 - 0.5,
        options.height / 2 - 0.5,
    )
    parameters.extrinsic = cam_from_world
    return parameters

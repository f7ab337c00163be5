"""Draw a scene to a PNG without a screen.

Open3D runs in its own process: without a driver, its renderer Filament aborts the process instead
of raising, and it prints to standard output.
"""

from __future__ import annotations

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from sfm_front.errors import DependencyError, InputError
from sfm_front.runtime.subprocess_env import module_command, module_environment
from sfm_front.viewers.model_drawing import Scene
from sfm_front.viewers.open3d_loader import INSTALL_HINT
from sfm_front.viewers.options import BACKGROUNDS, DrawOptions
from sfm_front.viewers.viewpoint import VERTICAL_FIELD_OF_VIEW_DEG

#: Exit status of the drawing process when Open3D cannot load; its last line says why.
CANNOT_LOAD = 3

_TIMEOUT_S = 300.0


def render_png(scene: Scene, options: DrawOptions, out: Path) -> None:
    """Write ``scene`` to ``out`` as a PNG; its folder is created.

    Raises ``DependencyError`` if Open3D cannot load or has no driver to draw with, and
    ``InputError`` if ``out`` cannot be written.
    """
    with TemporaryDirectory(prefix="sfm_front_view_") as folder:
        drawing, picture = Path(folder) / "drawing.npz", Path(folder) / "picture.png"
        np.savez(
            drawing,
            points=scene.points,
            point_colors=scene.point_colors,
            vertices=scene.vertices,
            lines=scene.lines,
            line_colors=scene.line_colors,
            eye=scene.view.eye,
            target=scene.view.target,
            up=scene.view.up,
            size=[options.width, options.height],
            point_size_px=scene.point_size_px,
            background=BACKGROUNDS[options.background][0],
            field_of_view_deg=VERTICAL_FIELD_OF_VIEW_DEG,
        )
        _draw(drawing, picture)
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            out.write_bytes(picture.read_bytes())
        except OSError as error:
            raise InputError(f"{out}: cannot be written ({error.strerror})") from error


def _draw(drawing: Path, picture: Path) -> None:
    command = module_command("sfm_front.viewers.offscreen_process")
    try:
        done = subprocess.run(
            [*command, str(drawing), str(picture)],
            env=_environment(),
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
        )
    except subprocess.TimeoutExpired as error:
        raise DependencyError(
            f"open3d drew no picture in {_TIMEOUT_S:.0f} s; try a smaller --size"
        ) from error
    if done.returncode == CANNOT_LOAD:
        raise DependencyError(done.stderr.strip().splitlines()[-1])
    if done.returncode or not picture.is_file():
        raise DependencyError(
            "open3d cannot draw without a screen: no usable Vulkan or EGL driver; " + INSTALL_HINT
        )


def _environment() -> dict[str, str]:
    """An environment in which EGL does not look for a screen."""
    environment = module_environment()
    environment["EGL_PLATFORM"] = environment.get("EGL_PLATFORM") or "surfaceless"
    return environment

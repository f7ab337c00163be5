"""Look at a reconstructed model: in a window, or as a picture."""

from __future__ import annotations

from pathlib import Path

from sfm_front.storage.colmap_models import read_model
from sfm_front.viewers.model_drawing import build_scene
from sfm_front.viewers.options import DrawOptions


def view(model: Path, options: DrawOptions | None = None) -> None:
    """Show the COLMAP model in folder ``model`` in a window; return when it is closed.

    Raises ``InputError`` if the folder holds no model that can be drawn, ``DependencyError``
    if Open3D cannot load or there is no screen.
    """
    from sfm_front.viewers.open3d_window import show

    options = options or DrawOptions()
    show(build_scene(read_model(model), options), options, title=f"sfm_front: {model}")


def screenshot(model: Path, out: Path, options: DrawOptions | None = None) -> None:
    """Draw the COLMAP model in folder ``model`` to the PNG ``out``; needs no screen.

    Raises ``InputError`` if the folder holds no model that can be drawn or ``out`` cannot be
    written, ``DependencyError`` if Open3D cannot load or has no driver to draw with.
    """
    from sfm_front.viewers.offscreen import render_png

    options = options or DrawOptions()
    render_png(build_scene(read_model(model), options), options, out)

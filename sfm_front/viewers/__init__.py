"""Look at reconstructed models: in a window, or as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sfm_front.storage.colmap_models import read_model
from sfm_front.types import Float64Array
from sfm_front.viewers.model_drawing import Scene, build_scene
from sfm_front.viewers.options import DrawOptions
from sfm_front.viewers.side_by_side import UP, place_side_by_side


def view(
    models: Path | Sequence[Path],
    options: DrawOptions | None = None,
    up: Float64Array | None = None,
) -> None:
    """Show COLMAP models, by their folders, in a window; return when it is closed.

    ``up`` (3,): upwards in the world that they have in common. Without it, several stand side by
    side, each upright as its cameras tell. Raises ``InputError`` if a folder holds no model that
    can be drawn, ``DependencyError`` if Open3D cannot load or there is no screen.
    """
    from sfm_front.viewers.open3d_window import show

    options = options or DrawOptions()
    folders = _several(models)
    scene = _scene(folders, options, up)
    title = ", ".join([f"sfm_front: {', '.join(map(str, folders))}", *scene.legends])
    show(scene, options, title)


def screenshot(
    models: Path | Sequence[Path],
    out: Path,
    options: DrawOptions | None = None,
    up: Float64Array | None = None,
) -> tuple[str, ...]:
    """Draw them to the PNG ``out``; needs no screen. Returns what the colours of points say, for
    each model where that is a quantity.

    Raises ``InputError`` if a folder holds no model that can be drawn or ``out`` cannot be
    written, ``DependencyError`` if Open3D cannot load or has no driver to draw with.
    """
    from sfm_front.viewers.offscreen import render_png

    options = options or DrawOptions()
    scene = _scene(_several(models), options, up)
    render_png(scene, options, out)
    return scene.legends


def _several(models: Path | Sequence[Path]) -> Sequence[Path]:
    return [models] if isinstance(models, Path) else models


def _scene(folders: Sequence[Path], options: DrawOptions, up: Float64Array | None) -> Scene:
    models = [read_model(folder) for folder in folders]
    if up is None and len(models) > 1 and all(model.num_reg_images() for model in models):
        place_side_by_side(models)
        up = UP
    return build_scene(models, options, up)

"""The drawing process of ``offscreen``: DRAWING.npz PICTURE.png."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from sfm_front.errors import DependencyError
from sfm_front.viewers.offscreen import CANNOT_LOAD
from sfm_front.viewers.open3d_loader import load_open3d

#: Drawn larger by this factor, then reduced: smooth points and lines on any driver.
_OVERSAMPLING = 2
_LINE_WIDTH_PX = 1.5


def main(drawing: Path, picture: Path) -> int:
    """Draw the arrays of ``drawing``; exit status ``CANNOT_LOAD`` if Open3D does not load."""
    try:
        o3d = load_open3d()
    except DependencyError as error:
        print(error, file=sys.stderr)
        return CANNOT_LOAD
    with np.load(drawing) as arrays:
        pixels = _render(o3d, {name: arrays[name] for name in arrays.files})
    Image.fromarray(pixels).save(picture)
    return 0


def _render(o3d: Any, arrays: dict[str, Any]) -> Any:
    """Pixels (height, width, 3) uint8."""
    width, height = (int(side) for side in arrays["size"])
    renderer = o3d.visualization.rendering.OffscreenRenderer(
        _OVERSAMPLING * width, _OVERSAMPLING * height
    )
    scene = renderer.scene
    scene.view.set_post_processing(False)  # tone mapping would change the colours
    # The renderer takes the background, and nothing else, for sRGB and converts it to linear.
    scene.set_background([*_srgb_from_linear(arrays["background"]), 1.0])

    if len(arrays["points"]):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(arrays["points"]))
        cloud.colors = o3d.utility.Vector3dVector(arrays["point_colors"])
        material = o3d.visualization.rendering.MaterialRecord()
        material.shader = "defaultUnlit"
        material.point_size = float(arrays["point_size_px"]) * _OVERSAMPLING
        scene.add_geometry("points", cloud, material)

    if len(arrays["lines"]):
        lines = o3d.geometry.LineSet(
            o3d.utility.Vector3dVector(arrays["vertices"]),
            o3d.utility.Vector2iVector(arrays["lines"]),
        )
        lines.colors = o3d.utility.Vector3dVector(arrays["line_colors"])
        material = o3d.visualization.rendering.MaterialRecord()
        material.shader = "unlitLine"
        material.line_width = _LINE_WIDTH_PX * _OVERSAMPLING
        scene.add_geometry("cameras", lines, material)

    renderer.setup_camera(
        float(arrays["field_of_view_deg"]), arrays["target"], arrays["eye"], arrays["up"]
    )
    drawn = Image.fromarray(np.asarray(renderer.render_to_image()))
    return np.asarray(drawn.resize((width, height), Image.Resampling.LANCZOS))


def _srgb_from_linear(linear: Any) -> Any:
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


if __name__ == "__main__":
    raise SystemExit(main(Path(sys.argv[1]), Path(sys.argv[2])))

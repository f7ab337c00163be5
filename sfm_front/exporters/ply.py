"""The points of a model as a coloured PLY point cloud, with normals where a reader wants them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap

from sfm_front.exporters.colmap import POINT_CLOUD
from sfm_front.exporters.scene import Job

_PLACE = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
_NORMAL = [("nx", "<f4"), ("ny", "<f4"), ("nz", "<f4")]
_COLOR = [("red", "u1"), ("green", "u1"), ("blue", "u1")]
_TYPE_NAMES = {"<f4": "float", "u1": "uchar"}


def write(job: Job) -> list[str]:
    """``points3D.ply``: in the coordinates of the model."""
    write_point_cloud(job.scene.model, job.folder / POINT_CLOUD)
    return []


def write_point_cloud(model: pycolmap.Reconstruction, file: Path, *, normals: bool = False) -> None:
    """Binary, little-endian; float32 positions, in the order of the points' ids.

    ``normals``: with normals, all zero, as 3D Gaussian splatting writes and expects them: nothing
    is known of surfaces.
    """
    fields = [*_PLACE, *(_NORMAL if normals else ()), *_COLOR]
    points = [model.point3D(point_id) for point_id in sorted(model.point3D_ids())]
    table = np.zeros(len(points), fields)
    for names, values in (
        (_PLACE, [point.xyz for point in points]),
        (_COLOR, [point.color for point in points]),
    ):
        columns = np.array(values).reshape(-1, 3)
        for (name, _), column in zip(names, columns.T, strict=True):
            table[name] = column
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(points)}",
        *(f"property {_TYPE_NAMES[kind]} {name}" for name, kind in fields),
        "end_header\n",
    ]
    file.write_bytes("\n".join(header).encode("ascii") + table.tobytes())

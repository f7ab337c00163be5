"""Control points of synthetic scenes, as a surveyor writes them: ODM's gcp_list.txt."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sfm_front.evaluation.synthetic.scene import SyntheticScene
from sfm_front.geometry.enu import LocalFrame
from sfm_front.types import Float64Array

# Photos that must see a point.
_MIN_MARKS = 3
# Of marks, along each axis.
MARK_NOISE_PX = 0.1


@dataclass(frozen=True)
class Row:
    """A mark: one line of the file. Pixels count from the centre of the first one, as in ODM."""

    point: str
    place: tuple[float, float, float]
    xy: tuple[float, float]
    photo: str


def control_rows(
    scene: SyntheticScene, frame: LocalFrame, *, num_control: int = 6, num_checks: int = 3
) -> list[Row]:
    """Marks of points that are far from each other, where the scene is in this frame. Checkpoints,
    ``check0_check`` and so on, come after control points, ``gcp0`` and so on."""
    marks = [_marks(scene, point) for point in scene.points]
    seen = [index for index, of_point in enumerate(marks) if len(of_point) >= _MIN_MARKS]
    chosen = [seen[0]]
    while len(chosen) < num_control + num_checks:
        gaps = scene.points[seen][:, None, :2] - scene.points[chosen][None, :, :2]
        chosen.append(seen[int(np.linalg.norm(gaps, axis=2).min(axis=1).argmax())])
    names = [f"gcp{n}" for n in range(num_control)] + [f"{n}_check" for n in range(num_checks)]
    places = frame.to_wgs84(scene.points[chosen])
    rng = np.random.default_rng(0)
    rows = []
    for name, index, (latitude, longitude, altitude) in zip(names, chosen, places, strict=True):
        for photo, xy in marks[index].items():
            x, y = xy + rng.normal(0, MARK_NOISE_PX, 2) - 0.5
            rows.append(Row(name, (longitude, latitude, altitude), (x, y), photo))
    return rows


def write_gcp_list(file: Path, rows: list[Row], *, with_heights: bool = True) -> Path:
    lines = ["EPSG:4326"]
    for row in rows:
        longitude, latitude, altitude = row.place
        height = f"{altitude:.4f}" if with_heights else "nan"
        lines.append(
            f"{longitude:.10f} {latitude:.10f} {height} {row.xy[0]:.3f} {row.xy[1]:.3f} "
            f"{row.photo} {row.point}"
        )
    file.write_text("\n".join(lines) + "\n")
    return file


def _marks(scene: SyntheticScene, point: Float64Array) -> dict[str, Float64Array]:
    """Name of the photo → pixel (2,), where the point is well inside of it."""
    size = np.array([scene.camera.width, scene.camera.height])
    found = {}
    for index, pose in enumerate(scene.cams_from_world):
        xy = scene.camera.img_from_cam((pose * point)[None])[0]
        if (xy > 20).all() and (xy < size - 20).all():
            found[scene.name(index)] = xy
    return found

"""Cameras as adjusted, against what they started from, and what is left over the photo."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import pycolmap

from sfm_front.reports.html.markup import Html, joined, section, table, tag
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.residual_grid import residual_grid

_MOST_ROWS = 40
_MOST_GRIDS = 4


@dataclass(frozen=True, slots=True, eq=False)
class CameraResult:
    """A camera of the largest model: ``focal_px``, mean of x and y; ``exif_px``: what EXIF or the
    user said, None if neither did."""

    camera: pycolmap.Camera
    num_photos: int
    focal_px: float
    exif_px: float | None

    @property
    def change(self) -> float | None:
        """Of the focal length, as a share of what was said."""
        return None if self.exif_px is None else self.focal_px / self.exif_px - 1


def camera_results(material: Material) -> list[CameraResult]:
    """Those with most photos first; empty without a model."""
    if not material.models:
        return []
    model = material.models[0]
    counts = Counter(model.images[i].camera_id for i in model.reg_image_ids())
    results = []
    for camera_id, num_photos in counts.most_common():
        start = material.session.cameras.get(camera_id)
        said = start is not None and start.has_prior_focal_length
        results.append(
            CameraResult(
                model.cameras[camera_id],
                num_photos,
                float(model.cameras[camera_id].mean_focal_length()),
                float(start.mean_focal_length()) if start is not None and said else None,
            )
        )
    return results


def cameras(material: Material, results: list[CameraResult]) -> Html | None:
    """The section; None without a model."""
    observations = material.observations
    if observations is None:
        return None
    shown = results[:_MOST_ROWS]
    rest = len(results) - len(shown)
    head = ("camera", "model", "photos", "size", "focal length", "EXIF", "change", "parameters")
    grids = [
        residual_grid(material.models[0], observations, result.camera.camera_id)
        for result in results[:_MOST_GRIDS]
    ]
    return section(
        "cameras",
        "Cameras",
        table(head, map(_row, shown), numbers_from=2),
        tag("p", f"{rest} more cameras with fewer photos.", class_="note") if rest else None,
        tag("div", joined(grids), class_="columns"),
    )


def _row(result: CameraResult) -> list[object]:
    camera = result.camera
    names = [name.strip() for name in camera.params_info.split(",")]
    params = ", ".join(
        f"{name} {value:.5g}" for name, value in zip(names, camera.params, strict=False)
    )
    change = result.change
    return [
        camera.camera_id,
        camera.model_name,
        result.num_photos,
        f"{camera.width} × {camera.height}",
        f"{result.focal_px:.1f} px",
        "not said" if result.exif_px is None else f"{result.exif_px:.1f} px",
        "" if change is None else f"{100 * change:+.2f} %",
        tag("span", params, class_="params"),
    ]

"""How far one photo is from where it was measured to be, read back from a finished output."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pycolmap

from sfm_front.georeference.sidecar import Sidecar
from sfm_front.reports.run_summary import PhotoOutcome, RunSummary
from sfm_front.storage.colmap_models import read_model
from sfm_front.storage.database import DATABASE
from sfm_front.types import Float64Array


def position_in_words(output: Path, summary: RunSummary, photo: PhotoOutcome) -> str:
    """A line, or nothing where no position of the photo is known."""
    sidecar = summary.georeference.sidecar if summary.georeference else None
    if sidecar is None:
        return ""
    if photo.name in sidecar.left_out:
        return f"its position is left out: {sidecar.left_out[photo.name]}"
    away = _position_less_camera(output, summary, sidecar, photo)
    if away is None:
        return ""
    wrong = ", and taken for wrong" if photo.image_id in sidecar.names else ""
    return (
        f"its position is {np.hypot(away[0], away[1]):.2f} m away in the plane, {away[2]:+.2f} m "
        f"in height{wrong}"
    )


def _position_less_camera(
    output: Path, summary: RunSummary, sidecar: Sidecar, photo: PhotoOutcome
) -> Float64Array | None:
    """(3,) metres east, north and up, as positions are given; None unless its model is in ENU."""
    if photo.model is None or photo.model not in sidecar.models_in_enu or sidecar.origin is None:
        return None
    with pycolmap.Database.open(output / DATABASE) as database:
        priors = {p.corr_data_id.id: p.position.ravel() for p in database.read_all_pose_priors()}
    if photo.image_id not in priors:
        return None
    model = read_model(output / summary.models[photo.model].path)
    enu = sidecar.origin.to_enu(priors[photo.image_id])[0]
    away: Float64Array = enu - model.image(photo.image_id).projection_center()
    return away

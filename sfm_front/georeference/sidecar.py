"""georeference.json: where the models beside it stand on the earth. README.md has the format."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pycolmap

from sfm_front.errors import InputError
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.accuracy import (
    AxisResiduals,
    Bend,
    Outlier,
    ResidualSummary,
    summarise,
)
from sfm_front.georeference.anchors import camera_centres
from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.georeferencer import Georeference
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.storage.json_files import write_json

FILE_NAME = "georeference.json"
VERSION = 1

_CRS = {
    "kind": "topocentric east, north, up",
    "datum": "WGS84",
    "ellipsoid": {"semi_major_axis_m": 6378137.0, "inverse_flattening": 298.257223563},
    "vertical_datum": "unknown",
    "unit": "metre",
}


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Standard deviations of the alignment: share of the scale, degrees, and metres east, north and
    up in the middle of the photos."""

    scale: float
    tilt_deg: float
    heading_deg: float
    position_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sidecar:
    """What the file says.

    ``models_in_enu``: numbers of those beside it that are in ENU. ``enu_from_built``: from the
    frame in which the largest was built. ``names``: of the photos of outliers, by image id.
    ``left_out``: photos whose position was not fit for use, by name, and why. ``flight``: of the
    largest model, once it is finished and in ENU.
    """

    state: GeoreferenceState
    reasons: tuple[str, ...] = ()
    origin: LocalFrame | None = None
    models_in_enu: tuple[int, ...] = ()
    enu_from_built: pycolmap.Sim3d | None = None
    uncertainty: Uncertainty | None = None
    residuals: ResidualSummary | None = None
    names: Mapping[int, str] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    height_offsets_m: Mapping[int, float] = field(default_factory=dict)
    flight: FlightFigures | None = None
    control_points: ControlReport | None = None


def sidecar_of(
    georeference: Georeference,
    names: Mapping[int, str],
    left_out: Mapping[str, str],
    *,
    enu_from_built: pycolmap.Sim3d | None,
    models_in_enu: tuple[int, ...],
    flight: FlightFigures | None = None,
) -> Sidecar:
    """Of the largest model; ``names`` of the photos of its georeference, by image id."""
    alignment = georeference.alignment
    if alignment is None:
        return Sidecar(
            state=georeference.state,
            reasons=georeference.reasons,
            origin=georeference.frame,
            models_in_enu=models_in_enu,
            enu_from_built=enu_from_built,
            left_out=left_out,
            flight=flight,
        )
    centres = camera_centres(georeference.cam_from_model)
    east, north, up = alignment.position_sigmas_m(centres.mean(axis=0)[None])[0].tolist()
    residuals = summarise(alignment, centres, georeference.image_ids)
    return Sidecar(
        state=georeference.state,
        reasons=georeference.reasons,
        origin=georeference.frame,
        models_in_enu=models_in_enu,
        enu_from_built=enu_from_built,
        uncertainty=Uncertainty(
            alignment.scale_sigma,
            alignment.tilt_sigma_deg,
            alignment.heading_sigma_deg,
            (east, north, up),
        ),
        residuals=residuals,
        names={outlier.image_id: names[outlier.image_id] for outlier in residuals.outliers},
        left_out=left_out,
        height_offsets_m=alignment.height_offsets,
        flight=flight,
    )


def write_sidecar(path: Path, sidecar: Sidecar) -> None:
    """Write the file, whole or not at all. Raises InputError if it cannot be written."""
    write_json(path, as_row(sidecar))


def as_row(sidecar: Sidecar) -> dict[str, Any]:
    """What the file says, ready for JSON; read by ``of_row``."""
    origin, moved = sidecar.origin, sidecar.enu_from_built
    return {
        "version": VERSION,
        "state": sidecar.state.value,
        "reasons": list(sidecar.reasons),
        "crs": _CRS,
        "origin": origin and asdict(origin),
        "models_in_enu": list(sidecar.models_in_enu),
        "enu_from_built": moved
        and {
            "scale": float(moved.scale),  # pycolmap hands out an array
            "rotation_xyzw": moved.rotation.quat.tolist(),
            "translation_m": moved.translation.tolist(),
        },
        "uncertainty": sidecar.uncertainty and asdict(sidecar.uncertainty),
        "residuals": sidecar.residuals and _residual_rows(sidecar.residuals, sidecar.names),
        "left_out": [{"name": name, "reason": reason} for name, reason in sidecar.left_out.items()],
        "height_offsets": [
            {"flight": flight, "metres": metres}
            for flight, metres in sidecar.height_offsets_m.items()
        ],
        "flight": sidecar.flight and asdict(sidecar.flight),
        "control_points": sidecar.control_points and sidecar.control_points.as_json(),
    }


def read_sidecar(path: Path) -> Sidecar:
    """Back from the file. Raises InputError if it cannot be read or is of another version."""
    try:
        row = json.loads(path.read_bytes())
        if row["version"] != VERSION:
            raise InputError(
                f"{path}: version {row['version']}, this program reads {VERSION}. Update sfm-front."
            )
        return of_row(row)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"{path}: cannot be read ({reason}). Give a folder that has it."
        ) from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: not a {FILE_NAME}. Reconstruct again to write it.") from error


def of_row(row: Mapping[str, Any]) -> Sidecar:
    """Back from ``as_row``. Raises KeyError, TypeError or ValueError for anything else."""
    moved, residuals, uncertainty = row["enu_from_built"], row["residuals"], row["uncertainty"]
    control = row.get("control_points")
    return Sidecar(
        state=GeoreferenceState(row["state"]),
        reasons=tuple(row["reasons"]),
        origin=row["origin"] and LocalFrame(**row["origin"]),
        models_in_enu=tuple(row["models_in_enu"]),
        enu_from_built=moved
        and pycolmap.Sim3d(
            moved["scale"],
            pycolmap.Rotation3d(np.array(moved["rotation_xyzw"])),
            np.array(moved["translation_m"]),
        ),
        uncertainty=uncertainty
        and Uncertainty(**{**uncertainty, "position_m": tuple(uncertainty["position_m"])}),
        residuals=residuals and _residuals_of(residuals),
        names={one["image_id"]: one["name"] for one in residuals["outliers"]} if residuals else {},
        left_out={one["name"]: one["reason"] for one in row["left_out"]},
        height_offsets_m={one["flight"]: one["metres"] for one in row["height_offsets"]},
        # Both are absent in files of earlier versions.
        control_points=None if control is None else ControlReport.of_json(control),
        flight=row.get("flight") and FlightFigures(**row["flight"]),
    )


def _residual_rows(residuals: ResidualSummary, names: Mapping[int, str]) -> dict[str, Any]:
    outliers = [
        {"image_id": one.image_id, "name": names[one.image_id], "metres": one.metres}
        for one in residuals.outliers
    ]
    return {**asdict(residuals), "outliers": outliers}


def _residuals_of(row: Mapping[str, Any]) -> ResidualSummary:
    axes = {name: row[name] and AxisResiduals(**row[name]) for name in ("east", "north", "up")}
    outliers = tuple(Outlier(one["image_id"], one["metres"]) for one in row["outliers"])
    bend = row["bend"] and Bend(**row["bend"])
    return ResidualSummary(**{**row, **axes, "outliers": outliers, "bend": bend})

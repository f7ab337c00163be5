"""How well the model agrees with measured positions, and what the flight was."""

from __future__ import annotations

from sfm_front.georeference.accuracy import ResidualSummary
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.sidecar import Sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.html.control_points import control_points
from sfm_front.reports.html.markup import Html, joined, table, tag
from sfm_front.reports.html.material import Material
from sfm_front.reports.words import counted

_MOST_OUTLIERS = 10

_IN_ENU = "The model is in metres, east, north and up."
_STATES = {
    GeoreferenceState.METRIC: "Positions fix the model, which is in a frame of its own.",
    GeoreferenceState.PROVISIONAL: "Positions do not fix the model yet: it is in a frame of its "
    "own.",
    GeoreferenceState.NONE: "Positions say nothing about the model: it is in a frame of its own.",
}


def accuracy(material: Material) -> Html | None:
    """None where nothing was measured."""
    sidecar = material.sidecar
    if sidecar is None:
        return None
    residuals = sidecar.residuals
    reasons = [tag("li", reason) for reason in sidecar.reasons]
    tables = joined([_by_axis(residuals), _outliers(sidecar, residuals), _left_out(sidecar)])
    facts = _definitions([*_flight(material.flight), *_facts(sidecar, residuals)])
    return joined(
        [
            tag("p", _STATES[sidecar.state] if material.frame is None else _IN_ENU),
            tag("ul", joined(reasons)) if reasons else None,
            tag("div", tag("div", tables) if tables else None, facts, class_="columns"),
            control_points(sidecar.control_points),
        ]
    )


def _by_axis(residuals: ResidualSummary | None) -> Html | None:
    if residuals is None:
        return None
    rows = [
        [name, *(f"{round(value, 2) + 0.0:.2f}" for value in (axis.mean, axis.sigma, axis.rms))]
        for name, axis in (
            ("east", residuals.east),
            ("north", residuals.north),
            ("up", residuals.up),
        )
        if axis is not None
    ]
    return table(("position less camera, m", "mean", "σ", "RMS"), rows)


def _facts(sidecar: Sidecar, residuals: ResidualSummary | None) -> list[tuple[str, str]]:
    if residuals is None:
        return []
    facts = [
        ("CE90, in the plane", f"{residuals.ce90_m:.2f} m"),
        ("LE90, in height", "" if residuals.le90_m is None else f"{residuals.le90_m:.2f} m"),
        ("positions used", str(residuals.num_used)),
    ]
    uncertainty = sidecar.uncertainty
    if uncertainty is not None:
        east, north, up = uncertainty.position_m
        facts += [
            ("scale", f"± {100 * uncertainty.scale:.2g} %"),
            ("tilt, heading", f"± {uncertainty.tilt_deg:.2g}°, ± {uncertainty.heading_deg:.2g}°"),
            ("middle of the photos", f"± {max(east, north):.2g} m, height ± {up:.2g} m"),
        ]
    if residuals.bend is not None:
        share = 100 * residuals.bend.share_of_extent
        facts.append(("bend of the heights", f"{residuals.bend.metres:.2f} m, {share:.2g} %"))
    for flight, metres in sidecar.height_offsets_m.items():
        facts.append((f"heights of flight {flight}", f"{metres:+.2f} m against the others"))
    if sidecar.origin is not None:
        origin = sidecar.origin
        facts.append(
            (
                "origin",
                f"{origin.latitude_deg:.6f}°, {origin.longitude_deg:.6f}°, "
                f"{origin.altitude_m:.1f} m",
            )
        )
    return facts


def _flight(flight: FlightFigures | None) -> list[tuple[str, str]]:
    if flight is None:
        return []
    area = (
        f"{flight.area_m2 / 10_000:.2f} ha" if flight.area_m2 > 1000 else f"{flight.area_m2:.0f} m²"
    )
    return [
        ("ground sampling distance", f"{flight.gsd_cm_per_px:.2f} cm/px"),
        ("flying height", f"{flight.height_m:.0f} m"),
        ("area", area),
    ]


def _definitions(facts: list[tuple[str, str]]) -> Html:
    """Names and values; those without a value are left out."""
    pairs = (tag("div", tag("dt", name), tag("dd", value)) for name, value in facts if value)
    return tag("dl", joined(pairs), class_="facts")


def _outliers(sidecar: Sidecar, residuals: ResidualSummary | None) -> Html | None:
    if residuals is None or not residuals.outliers:
        return None
    rows = [
        [sidecar.names.get(one.image_id, one.image_id), f"{one.metres:.1f} m"]
        for one in residuals.outliers[:_MOST_OUTLIERS]
    ]
    return table(
        (f"{counted(len(residuals.outliers), 'position')} taken for wrong", "off by"), rows
    )


def _left_out(sidecar: Sidecar) -> Html | None:
    if not sidecar.left_out:
        return None
    rows = list(sidecar.left_out.items())[:_MOST_OUTLIERS]
    return table(
        (f"{counted(len(sidecar.left_out), 'position')} not used", "why"), rows, numbers_from=2
    )

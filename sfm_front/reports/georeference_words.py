"""What measured positions say of the models, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from sfm_front.georeference.accuracy import AxisResiduals, Bend, Outlier, ResidualSummary
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.sidecar import Sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.run_summary import GeoreferenceOutcome

# Positions named one by one; report.json names all.
_MOST_NAMED = 5
_SQUARE_METRES_PER_HECTARE = 10_000
# From here on a bend is worth a word on what helps. A bend alone has a range of more than three
# times its RMS; noise of a dozen heights that is taken for one, mostly of less than this.
_BENT_SHARE = 0.005
_BENT_PER_RMS = 2.5

_WHAT_HELPS = {
    GeoreferenceState.NONE: "photos with positions from at least five places help, or --gps FILE",
    GeoreferenceState.PROVISIONAL: "photos with positions help that cover a wider area, not a line",
}


def georeference_lines(outcome: GeoreferenceOutcome) -> list[str]:
    """At most eight lines for the closing summary; those of ``report.json`` in full."""
    lines = [] if outcome.sidecar is None else list(_of_models(outcome.sidecar))
    if outcome.kept_positions is False:
        lines.append(
            "the photos contradict the positions: the last adjustment is by the photos alone"
        )
    unused = outcome.num_unused_rows
    if unused:
        rows, name = ("row", "names") if unused == 1 else ("rows", "name")
        lines.append(f"{unused} {rows} of the file of positions {name} no photo")
    return lines


def _of_models(sidecar: Sidecar) -> Iterator[str]:
    """Of the largest model, as its sidecar has it."""
    residuals, is_metric = sidecar.residuals, sidecar.state is GeoreferenceState.METRIC
    reasons = "; ".join(sidecar.reasons)
    if sidecar.control_points and sidecar.control_points.model is not None:
        beside = "" if residuals is None else f"; {_positions(residuals)}; {_residuals(residuals)}"
        yield f"in metres (east, north, up): {reasons}{beside}"
    elif is_metric and residuals is not None:
        yield f"in metres (east, north, up): {_scale(sidecar)}; {_residuals(residuals)}"
        if reasons:
            yield f"beware: {reasons}"
    else:
        how = "in metres, though not for sure" if sidecar.models_in_enu else "not in metres"
        yield f"{how}: {reasons}; {_WHAT_HELPS.get(sidecar.state, '')}".rstrip("; ")
    left_out = [*_outliers(residuals, sidecar.names), *_left_out(sidecar.left_out)]
    if left_out:
        yield f"positions left out: {', '.join(left_out)}"
    if sidecar.height_offsets_m:
        offsets = (
            f"of flight {flight} by {metres:+.1f} m"
            for flight, metres in sidecar.height_offsets_m.items()
        )
        yield f"heights differ from those of the other flights: {', '.join(offsets)}"
    if is_metric and residuals is not None and residuals.bend is not None:
        yield _bend(residuals.bend, residuals.up, is_flight=sidecar.flight is not None)
    if sidecar.flight is not None:
        yield _flight(sidecar.flight)


def _scale(sidecar: Sidecar) -> str:
    residuals, uncertainty = sidecar.residuals, sidecar.uncertainty
    assert residuals is not None
    assert uncertainty is not None
    return f"scale ± {uncertainty.scale:.1%}, {_positions(residuals)}"


def _positions(residuals: ResidualSummary) -> str:
    total = residuals.num_used + len(residuals.outliers)
    return f"{residuals.num_used} of {total} positions"


def _residuals(residuals: ResidualSummary) -> str:
    axes: Mapping[str, AxisResiduals | None] = {
        "east": residuals.east,
        "north": residuals.north,
        "up": residuals.up,
    }
    by_axis = ", ".join(f"{axis} {row.rms:.2f}" for axis, row in axes.items() if row is not None)
    height = "" if residuals.le90_m is None else f", LE90 {residuals.le90_m:.2f} m"
    return f"residual {by_axis} m RMS; CE90 {residuals.ce90_m:.2f} m{height}"


def _outliers(residuals: ResidualSummary | None, names: Mapping[int, str]) -> list[str]:
    outliers: Sequence[Outlier] = residuals.outliers if residuals else ()
    named = [f"{names[one.image_id]} {one.metres:.0f} m away" for one in outliers[:_MOST_NAMED]]
    more = len(outliers) - _MOST_NAMED
    return named + ([f"{more} more less far away"] if more > 0 else [])


def _left_out(reasons: Mapping[str, str]) -> list[str]:
    """``a.jpg (far from all others)``, ``3 × the very same numbers as other photos``."""
    counted = Counter(reasons.values())
    if len(reasons) <= _MOST_NAMED and max(counted.values(), default=0) <= 2:
        return [f"{name} ({why})" for name, why in reasons.items()]
    return [f"{count} × {why}" for why, count in counted.items()]


def _bend(bend: Bend, up: AxisResiduals | None, *, is_flight: bool) -> str:
    is_bent = bend.share_of_extent > _BENT_SHARE and (
        is_flight and up is not None and bend.metres > _BENT_PER_RMS * up.rms
    )
    helps = "; a known camera, oblique photos or control points help" if is_bent else ""
    return (
        f"bend against the positions {bend.metres:.2g} m, {bend.share_of_extent:.2%} of the "
        f"extent{helps}"
    )


def _flight(flight: FlightFigures) -> str:
    hectares = flight.area_m2 / _SQUARE_METRES_PER_HECTARE
    area = f"{flight.area_m2:.0f} m²" if hectares < 0.1 else f"{hectares:.1f} ha"
    return (
        f"ground {flight.gsd_cm_per_px:.2g} cm per pixel, {flight.height_m:.0f} m above the "
        f"ground, {area}"
    )

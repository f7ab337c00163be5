"""What measured positions say of the models, in the closing summary."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers.georeference_making import FLIGHT, METRIC, RESIDUALS

from sfm_front.georeference.accuracy import AxisResiduals, Bend, Outlier
from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.sidecar import Sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.georeference_words import georeference_lines
from sfm_front.reports.run_summary import GeoreferenceOutcome

MOST_LINES = 8


def of(sidecar: Sidecar | None, **changes: object) -> list[str]:
    lines = georeference_lines(GeoreferenceOutcome(sidecar=sidecar, **changes))
    assert len(lines) <= MOST_LINES
    return lines


def test_a_metric_model_is_told_as_surveyors_state_it():
    assert of(METRIC) == [
        "in metres (east, north, up): scale ± 1.1%, 17 of 18 positions; "
        "residual east 0.18, north 0.35, up 0.18 m RMS; CE90 0.56 m, LE90 0.31 m",
        "positions left out: DJI_7.JPG 201 m away",
        "bend against the positions 0.4 m, 0.40% of the extent",
        "ground 2.1 cm per pixel, 55 m above the ground, 1.2 ha",
    ]


def test_all_that_can_be_said_fits_into_eight_lines():
    everything = replace(
        METRIC,
        reasons=("model and positions differ by 14 m in the plane, where positions claim 5 m",),
        left_out={"a.jpg": "frozen", "b.jpg": "frozen", "c.jpg": "frozen", "d.jpg": "far"},
        height_offsets_m={2: 14.8, 3: -2.0},
    )
    lines = of(everything, num_unused_rows=1, kept_positions=False)
    assert lines[1].startswith("beware: model and positions differ by 14 m in the plane")
    assert lines[2] == "positions left out: DJI_7.JPG 201 m away, 3 × frozen, 1 × far"
    assert lines[3] == (
        "heights differ from those of the other flights: of flight 2 by +14.8 m, "
        "of flight 3 by -2.0 m"
    )
    assert lines[-2:] == [
        "the photos contradict the positions: the last adjustment is by the photos alone",
        "1 row of the file of positions names no photo",
    ]
    assert len(lines) == MOST_LINES


def test_control_points_are_named_as_what_the_metres_rest_on():
    held = replace(
        METRIC,
        reasons=("held to 6 control points",),
        uncertainty=None,
        control_points=ControlReport(file="gcp_list.txt", model=0),
    )
    assert of(held)[0] == (
        "in metres (east, north, up): held to 6 control points; 17 of 18 positions; "
        "residual east 0.18, north 0.35, up 0.18 m RMS; CE90 0.56 m, LE90 0.31 m"
    )
    alone = replace(held, residuals=None, flight=None, names={})
    assert of(alone) == ["in metres (east, north, up): held to 6 control points"]


def test_few_positions_are_named_and_many_counted():
    few = {"a.jpg": "altitude 0", "b.jpg": "far away"}
    lines = of(replace(METRIC, residuals=replace(RESIDUALS, outliers=()), left_out=few))
    assert "positions left out: a.jpg (altitude 0), b.jpg (far away)" in lines
    outliers = tuple(Outlier(i, 100.0 - i) for i in range(8))
    names = {i: f"{i}.jpg" for i in range(8)}
    lines = of(replace(METRIC, residuals=replace(RESIDUALS, outliers=outliers), names=names))
    (line,) = (line for line in lines if line.startswith("positions left out"))
    assert line.endswith("4.jpg 96 m away, 3 more less far away")


@pytest.mark.parametrize(
    ("bend", "up_rms", "helps"),
    [
        (Bend(4.0, 0.04), 1.2, True),
        (Bend(4.0, 0.004), 1.2, False),  # little for its extent
        (Bend(4.0, 0.04), 5.0, False),  # no more than noise makes
    ],
)
def test_what_helps_against_a_bend_is_said_where_there_is_one(bend, up_rms, helps):
    up = AxisResiduals(0.0, up_rms, up_rms)
    lines = of(replace(METRIC, residuals=replace(RESIDUALS, bend=bend, up=up)))
    (line,) = (line for line in lines if line.startswith("bend"))
    assert ("control points help" in line) is helps


def test_without_heights_nothing_is_said_of_them():
    flat = replace(RESIDUALS, up=None, le90_m=None, bend=None, outliers=())
    first, *rest = of(replace(METRIC, residuals=flat, flight=None))
    assert first.endswith("residual east 0.18, north 0.35 m RMS; CE90 0.56 m")
    assert rest == []


@pytest.mark.parametrize(
    ("state", "told"),
    [
        (
            GeoreferenceState.NONE,
            "not in metres: 2 positions, 3 are needed; "
            "photos with positions from at least five places help, or --gps FILE",
        ),
        (
            GeoreferenceState.PROVISIONAL,
            "not in metres: 2 positions, 3 are needed; "
            "photos with positions help that cover a wider area, not a line",
        ),
    ],
)
def test_where_it_is_not_metric_it_says_why_and_what_helps(state, told):
    assert of(Sidecar(state=state, reasons=("2 positions, 3 are needed",))) == [told]


def test_small_areas_are_in_square_metres():
    lines = of(replace(METRIC, flight=FlightFigures(0.15, 3.0, 240.0)))
    assert lines[-1] == "ground 0.15 cm per pixel, 3 m above the ground, 240 m²"


def test_a_file_that_fits_no_photo_is_told_of():
    assert of(None, num_unused_rows=12) == ["12 rows of the file of positions name no photo"]
    assert of(None) == []
    assert georeference_lines(FLIGHT)[-1] == "3 rows of the file of positions name no photo"

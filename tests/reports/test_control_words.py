"""What a user reads of control points at the end."""

from __future__ import annotations

import math
from dataclasses import replace

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import (
    ControlAccuracy,
    MarkResidual,
    PointResidual,
    PointRole,
)
from sfm_front.reports.control_words import control_lines

GOOD = MarkResidual("a.jpg", 0.1, -0.2, True)
WRONG = MarkResidual("b.jpg", 30.0, 40.0, False)
BEHIND = MarkResidual("c.jpg", math.nan, math.nan, False)


def point(name: str, role: PointRole, *marks: MarkResidual) -> PointResidual:
    east, north, up = (None,) * 3 if role is PointRole.NOT_MEASURED else (0.3, -0.2, 0.1)
    return PointResidual(name, role, east, north, up, marks)


REPORT = ControlReport(
    file="gcp_list.txt",
    model=0,
    points=(
        *(point(f"g{n}", PointRole.CONTROL, GOOD) for n in range(3)),
        point("k_check", PointRole.CHECKPOINT, GOOD),
    ),
    control=ControlAccuracy(3, 0.011, 0.012, 0.013, 0.021, 0.022),
    checkpoints=ControlAccuracy(1, 0.031, 0.032, None, 0.041, None),
    sigma_factor=1.0,
)
FIRST = (
    "control points of gcp_list.txt: 3 of 3 hold sparse/0: RMS east 0.011, north 0.012, up 0.013 m;"
    " CE90 0.021 m, LE90 0.022 m"
)
CHECKED = "  1 checkpoints: RMS east 0.031, north 0.032 m; CE90 0.041 m"


def test_where_all_is_well_only_the_accuracy_is_told():
    assert control_lines(REPORT) == [FIRST, CHECKED]


def test_what_is_wrong_is_named():
    points = (
        *REPORT.points,
        point("moved", PointRole.LEFT_OUT, GOOD, WRONG),
        point("lone", PointRole.NOT_MEASURED, GOOD),
        point("odd", PointRole.CONTROL, GOOD, WRONG, BEHIND),
    )
    lines = control_lines(
        replace(REPORT, points=points, sigma_factor=12.3, missing_photos=("x.jpg", "y.jpg"))
    )
    assert lines[0].startswith("control points of gcp_list.txt: 3 of 6 hold")
    assert lines[1:] == [
        CHECKED,
        "  they are 12 times less exact than stated: look at marks and survey, or give "
        "--gcp-accuracy",
        "  moved (left out); east +0.300 m, north -0.200 m, up +0.100 m; mark in b.jpg off by "
        "50.0 px",
        "  lone is not measured: no two photos of the model have marks that agree",
        "  odd: its mark in b.jpg is off by 50.0 px",
        "  odd: its mark in c.jpg is off by more than can be told",
        "  marked, but not among the photos: x.jpg, y.jpg",
    ]


def test_of_many_wrong_points_the_first_are_named():
    many = tuple(point(f"m{n}", PointRole.LEFT_OUT, GOOD) for n in range(12))
    missing = tuple(f"{n}.jpg" for n in range(12))
    lines = control_lines(replace(REPORT, points=REPORT.points + many, missing_photos=missing))
    assert sum("left out" in line for line in lines) == 10
    assert "  … and 2 more" in lines
    assert lines[-1].endswith("8.jpg, 9.jpg, …")


def test_points_that_are_not_used_say_why_and_what_now():
    lines = control_lines(ControlReport(file="gcp_list.txt", not_used="Line 7 is wrong."))
    assert lines == [
        "control points of gcp_list.txt are not used, the models are as without them: "
        "Line 7 is wrong.",
        "  mend that and give the same command: it goes on from here",
    ]

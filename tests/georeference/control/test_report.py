import json
import math

import pytest

from sfm_front.georeference.control.report import ControlReport
from sfm_front.georeference.control.residuals import (
    ControlAccuracy,
    MarkResidual,
    PointResidual,
    PointRole,
)

GOOD = MarkResidual("a.jpg", 0.1, -0.2, True)
WRONG = MarkResidual("b.jpg", 30.0, 40.0, False)
BEHIND = MarkResidual("c.jpg", math.nan, math.nan, False)
REPORT = ControlReport(
    file="gcp_list.txt",
    model=1,
    missing_photos=("ä.jpg",),
    points=(
        PointResidual("p", PointRole.CONTROL, 0.01, -0.02, 0.03, (GOOD, WRONG)),
        PointResidual("q_check", PointRole.CHECKPOINT, 0.1, 0.2, None, (GOOD,)),
        PointResidual("r", PointRole.NOT_MEASURED, None, None, None, (BEHIND,)),
    ),
    control=ControlAccuracy(1, 0.01, 0.02, 0.03, 0.04, 0.05),
    checkpoints=ControlAccuracy(1, 0.1, 0.2, None, 0.3, None),
    sigma_factor=2.0,
    error_before_px=0.5,
    error_after_px=0.6,
)


@pytest.mark.parametrize("report", [REPORT, ControlReport(file="a.txt", not_used="line 3: no")])
def test_json_brings_everything_back(report):
    row = json.loads(json.dumps(report.as_json(), allow_nan=False))
    assert ControlReport.of_json(row).as_json() == report.as_json()
    again = ControlReport.of_json(row)
    assert (again.file, again.not_used, again.model) == (report.file, report.not_used, report.model)
    assert again.points[:2] == report.points[:2]
    assert again.control == report.control


def test_a_mark_of_which_nothing_is_known_comes_back_as_unknown():
    point = ControlReport.of_json(REPORT.as_json()).points[2]
    assert math.isnan(point.marks[0].x_px)


def test_wrong_marks_are_those_of_points_that_are_measured():
    assert REPORT.wrong_marks == [(REPORT.points[0], WRONG)]

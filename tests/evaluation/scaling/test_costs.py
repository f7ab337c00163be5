"""What a photo costs, from reports."""

from __future__ import annotations

import json

import pytest
from helpers.cluster_reports import measured, report_of

from sfm_front.errors import InputError
from sfm_front.evaluation.scaling.costs import ClusterRun, Costs


def test_a_run_is_read_from_its_report(tmp_path):
    path = tmp_path / "report.json"
    path.write_text(json.dumps(report_of(40, end_s=3.0)))
    run = ClusterRun.read(path)
    assert (run.num_photos, run.num_workers, run.end_seconds) == (40, 1, 3.0)
    # The wall without what is distributed, the cut and the end.
    assert run.start_seconds == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("nonsense", "not a report.json"),
        ("[]", "not a report.json"),
        ("{}", "not a report.json"),
        (json.dumps({**report_of(40), "cluster": None}), "without --cluster"),
        (json.dumps(report_of(40, lost=1)), "undisturbed"),
    ],
)
def test_other_files_are_refused_by_name(tmp_path, content, told):
    path = tmp_path / "report.json"
    path.write_text(content)
    with pytest.raises(InputError, match=told) as error:
        ClusterRun.read(path)
    assert str(path) in str(error.value)


def test_tasks_cost_what_they_took_per_photo():
    costs = Costs.of([measured(40)])
    assert costs.describe.seconds == pytest.approx(0.5)
    assert costs.match.seconds == pytest.approx(0.25)
    assert costs.grow.seconds == pytest.approx(0.1)
    assert costs.join.seconds == pytest.approx(0.04)
    assert costs.describe.num_bytes == pytest.approx(3e6)
    assert costs.overlap == pytest.approx(0.25)


def test_of_one_size_the_coordinator_works_in_proportion():
    costs = Costs.of([measured(40, end_s=3.0)])
    assert costs.end.at(40) == pytest.approx(3.0)
    assert costs.end.at(400) == pytest.approx(30.0)


def test_of_two_sizes_it_follows_a_power():
    costs = Costs.of([measured(40, end_s=2.0), measured(160, end_s=16.0)])
    assert costs.end.exponent == pytest.approx(1.5)
    assert costs.end.at(640) == pytest.approx(128.0)
    assert costs.end.between(160, 640) == pytest.approx(112.0)
    assert costs.end.at(0) == 0


def test_ends_of_larger_sessions_count_too():
    costs = Costs.of([measured(40, end_s=2.0)], {160: 16.0})
    assert costs.end.at(640) == pytest.approx(128.0)


def test_groups_of_several_sizes_cannot_be_compared():
    with pytest.raises(InputError, match="20, 30 photos"):
        Costs.of([measured(40, group_size=20), measured(40, group_size=30)])
    with pytest.raises(InputError, match="at least"):
        Costs.of([])

"""The benchmark's rows, as tables and as a chart."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sfm_front.errors import DependencyError, InputError
from sfm_front.evaluation.reconstruction import chart as benchmark_chart
from sfm_front.evaluation.reconstruction.benchmark import OURS, SIFT_ALONE, Outcome, Row
from sfm_front.evaluation.reconstruction.quality import Quality
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.evaluation.reconstruction.table import format_profile, format_table
from sfm_front.evaluation.reconstruction.types import Run


def row(scene, method, seconds, registered, **run):
    quality = Quality(
        registered=registered,
        registered_in_all=registered,
        models=int(registered > 0),
        points=100 * registered,
        reprojection_error_px=0.5 if registered else None,
        auc=None,
        pairs_joined=None,
        mixed=None,
        gps_residual_m=None,
    )
    made = Run(wall_seconds=seconds, peak_memory_bytes=3 * 2**20, **run)
    return Row(scene, method, (Outcome(made, quality),))


@pytest.fixture
def rows():
    scene = BenchmarkScene(name="scene", photos=Path("scene"), num_photos=4)
    alone = Run(wall_seconds=5.0, peak_memory_bytes=None)
    return [
        Row(scene, SIFT_ALONE, (Outcome(alone, None),)),
        row(scene, OURS, 10.0, 4, photo_seconds=(1.0, 2.0, 9.0), seconds_by_stage={"map": 2.5}),
        row(scene, "exhaustive", 25.0, 3),
        row(scene, "spatial", 3.0, 0, failure="these photos have no GPS position"),
    ]


def table(rows):
    lines = format_table(rows).splitlines()
    edges = [len(part) for part in lines[1].split("  ")]
    starts = np.cumsum([0] + [edge + 2 for edge in edges])
    cut = [[line[a : a + n].strip() for a, n in zip(starts, edges, strict=False)] for line in lines]
    return {line[1]: dict(zip(cut[0], line, strict=True)) for line in cut[2:] if line[1:2]}


def test_the_table_compares_with_ours(rows):
    cells = table(rows)
    assert cells[OURS]["seconds"] == "10.0"
    assert cells["exhaustive"]["speed-up"] == "2.50"
    assert cells[SIFT_ALONE]["speed-up"] == "0.50"
    assert cells["spatial"]["speed-up"] == "-"  # it has no model to be fast with
    assert cells[OURS]["photo median s"] == "2.00"
    assert cells[OURS]["p95 s"] == f"{np.percentile([1, 2, 9], 95):.2f}"
    assert cells["exhaustive"]["registered"] == "3/4"
    assert cells["exhaustive"]["memory MiB"] == "3"
    assert "AUC@1" not in cells[OURS]  # nothing to say in this column
    assert "scene, spatial: these photos have no GPS position" in format_table(rows)


def test_rows_are_means_over_runs(rows):
    both = Row(rows[1].scene, OURS, rows[1].outcomes + rows[2].outcomes)
    means = both.means()
    assert (means["seconds"], means["registered"], means["points"]) == (17.5, 3.5, 350)
    assert means["photo_seconds_median"] == 2.0
    assert both.stage_means() == {"map": 2.5}  # over the runs that know the stage
    assert table([both])[OURS]["registered"] == "3.5/4"


def test_the_profile_shows_shares_of_the_whole(rows):
    assert format_profile(rows[1]).splitlines()[1].split() == ["map", "2.50", "s", "25.0", "%"]


def test_the_chart_is_written(tmp_path, rows):
    pytest.importorskip("matplotlib")
    benchmark_chart.write_chart(rows, tmp_path / "new" / "chart.png")
    assert Image.open(tmp_path / "new" / "chart.png").size[0] > 500
    with pytest.raises(InputError, match="cannot write the chart"):
        benchmark_chart.write_chart(rows, tmp_path / "chart.nonsense")


def test_a_chart_without_matplotlib_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(DependencyError, match="pip install matplotlib"):
        benchmark_chart.check_matplotlib()

"""Streams of several lengths side by side, and the fit to them."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict

import numpy as np
import pytest
from helpers.locations import SCRIPTS

from sfm_front.errors import InputError
from sfm_front.evaluation.power_law import PowerLaw
from sfm_front.evaluation.reconstruction.scale import (
    Fit,
    Line,
    Scale,
    format_scale,
    read_result,
)
from sfm_front.evaluation.reconstruction.stream import Memory, PhotoCost, StreamResult

SCRIPT = SCRIPTS / "benchmark_stream.py"
MIB = 2**20


def flight(num_photos: int, *, peak_mib: int | None = None) -> StreamResult:
    """Photos of 0.1 s; every hundredth is followed by a refinement of 2 s, and the end takes a
    hundredth of the square of the photos."""
    photos = []
    for number in range(1, num_photos + 1):
        refine = 2.0 if number % 100 == 0 else 0.0
        seconds = 0.1 + refine
        photos.append(PhotoCost(0.2, 0.2 + 2 * refine, seconds, 300 * MIB, number, 0.004))
    peak = None if peak_mib is None else peak_mib * MIB
    return StreamResult(
        tuple(photos),
        finish_seconds=1.0,
        memory=Memory(100 * MIB, peak, 50 * MIB),
        num_registered=num_photos,
        auc=(0.9, 0.95, 0.99),
        finish_processor_seconds=num_photos**2 / 100,
        beside_processor_seconds=0.0,
    )


def test_a_refinement_is_spread_over_the_photos_before_it():
    scale = Scale.of(flight(600))
    # Of the wall seconds of that photo 4.0 of 4.2 are refinement, and so of its 2.1 CPU seconds.
    refinement = 2.1 * 4.0 / 4.2
    assert scale.early_seconds == pytest.approx(0.1 + refinement / 100)
    assert scale.growth == pytest.approx(1)
    assert scale.refinement_share == pytest.approx(6 * refinement / (600 * 0.1 + 6 * 2.0))
    assert scale.retrieval_seconds == pytest.approx(0.004)


def test_what_ran_beside_the_session_is_refinement():
    result = flight(600)
    beside = StreamResult(**{**vars_of(result), "beside_processor_seconds": 72.0})
    assert Scale.of(beside).refinement_share == pytest.approx((72 + 12) / (72 + 72), rel=0.01)


def vars_of(result: StreamResult) -> dict[str, object]:
    return {name: getattr(result, name) for name in StreamResult.__dataclass_fields__}


def test_laws_are_found():
    numbers = np.arange(1.0, 50)
    law = PowerLaw.through(numbers, 3 * numbers**1.5)
    assert (law.factor, law.exponent) == (pytest.approx(3), pytest.approx(1.5))
    assert law.at(100) == pytest.approx(3000)
    line = Line.through([1, 2, 5], [7, 9, 15])
    assert (line.start, line.per_photo, line.at(10)) == tuple(map(pytest.approx, (5, 2, 25)))


def test_the_fit_goes_on_as_the_streams_did():
    fit = Fit.to([flight(500, peak_mib=400), flight(1000, peak_mib=700)])
    assert fit.peak_bytes is not None
    assert fit.peak_bytes.at(10_000) == pytest.approx((100 + 0.6 * 10_000) * MIB)
    assert fit.finish_seconds.at(10_000) == pytest.approx(1e6)
    assert fit.photo_seconds(10_000) == pytest.approx(0.12, rel=0.01)


def test_memory_that_is_not_known_is_not_fitted():
    assert Fit.to([flight(500), flight(1000, peak_mib=700)]).peak_bytes is None


def test_the_table_has_a_line_for_each_stream_and_the_fit():
    lines = format_scale([flight(1000, peak_mib=700), flight(500, peak_mib=400)], 10_000).split(
        "\n"
    )
    assert [line.split()[0] for line in lines] == ["photos", "500", "1000", "fit:", "fit:", "fit:"]
    assert "6100 MiB for 10000" in lines[-1]
    (one,) = format_scale([flight(500)], 10_000).split("\n")[1:]
    assert one.split()[-3:] == ["300", "-", "90.0"]


def test_the_script_compares_what_it_has_written(tmp_path):
    files = [tmp_path / f"{number}.json" for number in (500, 700)]
    for file, number in zip(files, (500, 700), strict=True):
        file.write_text(json.dumps({"threads": 1, **asdict(flight(number, peak_mib=number))}))
        assert read_result(file) == flight(number, peak_mib=number)
    done = subprocess.run(
        [sys.executable, SCRIPT, "--compare", *files], capture_output=True, text=True, check=True
    )
    assert "10000 MiB for 10000" in done.stdout


@pytest.mark.parametrize("content", ["", "{}", "[]", '{"photos": [{"a": 1}]}'])
def test_what_is_no_result_is_refused(content, tmp_path):
    file = tmp_path / "a.json"
    file.write_text(content)
    with pytest.raises(InputError, match=r"a\.json: is not what benchmark_stream"):
        read_result(file)


@pytest.mark.slow
def test_the_script_flies_each_length_in_a_process_of_its_own(tmp_path):
    done = subprocess.run(
        [
            *(sys.executable, SCRIPT, "--photos", "200", "210", "--points", "60"),
            *("--threads", "1", "--json", tmp_path / "flight"),
        ],
        capture_output=True,
        text=True,
        check=True,
    )
    results = [read_result(tmp_path / f"flight.{number}.json") for number in (200, 210)]
    assert [len(result.photos) for result in results] == [200, 210]
    assert all(result.finish_processor_seconds > 0 for result in results)
    assert format_scale(results, 10_000) in done.stdout


def test_no_length_is_flown_if_one_is_too_short():
    done = subprocess.run(
        [sys.executable, SCRIPT, "--photos", "300", "50"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "--photos must be at least 200, got 50" in done.stderr

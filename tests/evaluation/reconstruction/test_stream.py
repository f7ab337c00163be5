"""The measure of what a photo costs by its place in a stream."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest
from helpers.locations import SCRIPTS

from sfm_front.errors import ConfigError
from sfm_front.evaluation.reconstruction.colmap_memory import colmap_memory_bytes
from sfm_front.evaluation.reconstruction.stream import (
    Memory,
    PhotoCost,
    StreamResult,
    run_stream,
)
from sfm_front.geometry.lenses import grown, take_intrinsics
from sfm_front.session.options import SessionOptions
from sfm_front.storage.colmap_models import read_model

SCRIPT = SCRIPTS / "benchmark_stream.py"
EXPONENT_TOLERANCE = 0.05
NO_MEMORY = Memory(None, None, None)


def result_of(costs: list[float], memory: list[int | None] | None = None) -> StreamResult:
    memory = memory or [None] * len(costs)
    photos = tuple(
        PhotoCost(cost, 2 * cost, cost, held, 1) for cost, held in zip(costs, memory, strict=True)
    )
    return StreamResult(photos, 1.0, NO_MEMORY, len(costs), (1.0, 1.0, 1.0))


def test_growth_compares_means():
    growth = result_of([1.0] * 100 + [1.0, 3.0] * 50 + [3.0] * 100).growth(
        slice(100, 200), slice(200, 300)
    )
    assert (growth.seconds, growth.seconds_with_refinement) == pytest.approx((1.5, 1.5))
    assert growth.processor_seconds == pytest.approx(1.5)
    assert growth.amortized_seconds == pytest.approx(1.5)


def test_a_refinement_is_spread_over_the_photos_since_the_one_before():
    costs = [(1, 3), (2, 2), (2, 2), (1, 7), (5, 5)]
    photos = tuple(PhotoCost(alone, refined, refined, None, 1) for alone, refined in costs)
    amortized = StreamResult(
        photos, 1.0, NO_MEMORY, len(costs), (1.0, 1.0, 1.0)
    ).amortized_seconds()
    np.testing.assert_allclose(amortized, [3, 4, 4, 3, 7])


@pytest.mark.parametrize("power", [0.0, 1.0])
def test_the_power_of_growth_is_found(power):
    costs = [float(number**power) for number in range(1, 1001)]
    assert result_of(costs).exponent(100) == pytest.approx(power, abs=EXPONENT_TOLERANCE)


def test_memory_is_a_slope():
    memory = [1000 + 50 * number for number in range(300)]
    assert result_of([1.0] * 300, memory).memory_per_photo(100) == pytest.approx(50)
    assert result_of([1.0] * 300).memory_per_photo(100) is None


def test_a_short_flight_goes_through_a_session(tmp_path):
    steps = []
    result = run_stream(
        6,
        250,
        tmp_path / "out",
        SessionOptions(global_descriptor="vlad", threads=1),
        seed=1,
        note=steps.append,
    )
    assert len(result.photos) == len(steps) == 6
    assert result.num_registered == result.photos[-1].num_registered == 6
    assert result.auc[2] > 0.9
    for photo in result.photos:
        assert 0 < photo.seconds <= photo.seconds_with_refinement
        assert photo.processor_seconds > 0
    memory = result.memory
    if memory.at_start is not None:
        assert result.peak_in_stream == max(photo.memory_bytes for photo in result.photos)
        # The kernel counts by the batch.
        assert 0.99 * result.peak_in_stream < memory.peak
        # Its share of what came since the start: 6 photos take less than what is loaded once.
        assert 0 < memory.colmap < memory.peak
    assert np.all([step.image_id is not None for step in steps])


def test_a_flight_with_gps_and_another_lens_is_measured_against_the_truth(tmp_path):
    output = tmp_path / "out"
    result = run_stream(
        24,
        300,
        output,
        SessionOptions(global_descriptor="vlad", threads=1),
        seed=1,
        note=lambda _: None,
        gps_noise_m=0.5,
        lens=(-0.1, 0.001, -0.001),
    )
    assert result.num_registered == 24
    assert result.auc[2] > 0.9
    assert result.bend_share < 0.01
    sidecar = json.loads((output / "sparse" / "georeference.json").read_text())
    assert sidecar["state"] == "metric"
    assert sidecar["residuals"]["median_m"] == pytest.approx(0.5 * np.sqrt(3), rel=0.5)


@pytest.mark.parametrize("noise", [0.0, -1.0, float("nan")])
def test_noise_of_gps_is_above_nothing(noise, tmp_path):
    options = SessionOptions(global_descriptor="vlad")
    with pytest.raises(ConfigError, match="the noise of GPS must be a number of metres above 0"):
        run_stream(20, 100, tmp_path, options, seed=0, note=print, gps_noise_m=noise)


def test_memory_is_told_of_models_whose_lenses_have_grown(tmp_path):
    options = SessionOptions(global_descriptor="vlad", threads=1)
    run_stream(6, 250, tmp_path, options, seed=1, note=lambda _: None)
    folder = tmp_path / "sparse" / "0"
    model = read_model(folder)
    for camera in model.cameras.values():
        take_intrinsics(camera, grown(camera, "OPENCV"))
    model.write(folder)
    memory = colmap_memory_bytes(tmp_path)
    assert memory is None or memory > 0


def test_one_photo_is_no_stream(tmp_path):
    options = SessionOptions(global_descriptor="vlad")
    with pytest.raises(ConfigError, match="at least two photos, got 1"):
        run_stream(1, 100, tmp_path, options, seed=0, note=print)


def test_the_script_refuses_streams_too_short_to_compare():
    ended = subprocess.run(
        [sys.executable, SCRIPT, "--photos", "50"], capture_output=True, text=True, check=False
    )
    assert ended.returncode == 2
    assert "--photos must be at least 200, got 50" in ended.stderr

"""Two alike cans on a table: photos of the one must not be taken for photos of the other."""

from __future__ import annotations

from pathlib import Path

import pycolmap
import pytest
from helpers.locations import DATA

from sfm_front.cli.main import main
from sfm_front.storage.colmap_models import read_model

SCENE = DATA / "lookalike_oats" / "images"
# By eye; the photos between them see neither can whole.
FIRST_CAN, SECOND_CAN = range(7), range(14, 23)
MIN_REGISTERED = 20
MAX_SHARE = 0.01

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SCENE.is_dir(), reason="needs ../shared/data"),
]


def test_no_points_are_seen_at_both_cans(tmp_path):
    output = tmp_path / "out"
    arguments = ["--order", "random", "--seed", "1", "--global-descriptor", "vlad"]
    assert main(["reconstruct", str(SCENE), "--output", str(output), *arguments]) == 0
    models = [read_model(folder) for folder in sorted((output / "sparse").glob("[0-9]*"))]
    registered = set().union(*(numbers(model).values() for model in models))
    assert len(registered) >= MIN_REGISTERED
    seen = [set(numbers_of_track) for model in models for numbers_of_track in tracks(model)]
    first = [track for track in seen if track.intersection(FIRST_CAN)]
    second = [track for track in seen if track.intersection(SECOND_CAN)]
    both = [track for track in first if track.intersection(SECOND_CAN)]
    assert len(both) <= MAX_SHARE * min(len(first), len(second))


def numbers(model: pycolmap.Reconstruction) -> dict[int, int]:
    """Image id → number of the photo in its name."""
    return {i: int(Path(model.image(i).name).stem[-4:]) for i in model.reg_image_ids()}


def tracks(model: pycolmap.Reconstruction) -> list[list[int]]:
    """The photos that each point is seen in, by number."""
    number = numbers(model)
    return [
        [number[element.image_id] for element in point.track.elements]
        for point in model.points3D.values()
    ]

"""Models in sparse/ while a session runs."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
import pycolmap
import pytest
from helpers.photo_stream import described

from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.events import FinishingBegan, FinishingStep
from sfm_front.session import snapshots
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session
from sfm_front.types import ExtractedPhoto

NUM_PHOTOS = 12


def options(**changes: object) -> SessionOptions:
    return SessionOptions(**({"global_descriptor": "vlad", "threads": 1} | changes))


@pytest.fixture(scope="module")
def orbit() -> SyntheticScene:
    return make_scene(NUM_PHOTOS, 400, seed=1, layout="orbit", outlier_ratio=0.05)


@pytest.fixture(scope="module")
def photos(orbit) -> list[ExtractedPhoto]:
    return [described(orbit, index) for index in range(NUM_PHOTOS)]


def test_points_have_their_colours_while_a_session_runs(photos, tmp_path, monkeypatch):
    # One after each photo, however long the one before took.
    monkeypatch.setattr(snapshots, "_MAX_SHARE", math.inf)
    output = tmp_path / "out"
    for given in (photos[:5], photos[5:8]):
        with Session(output, options(snapshot_seconds=1e-9), resume=True) as session:
            for photo in given:
                session.add_extracted(photo)
        model = pycolmap.Reconstruction(output / "sparse" / "0")
        colors = {i: photos[i - 1].features.colors for i in model.reg_image_ids()}
        for point in model.points3D.values():
            seen = [colors[e.image_id][e.point2D_idx] for e in point.track.elements]
            low, high = np.min(seen, axis=0), np.max(seen, axis=0)
            assert np.all((low <= point.color) & (point.color <= high))


def test_what_the_last_look_has_placed_is_written_before_the_last_adjustment(
    photos, tmp_path, monkeypatch
):
    monkeypatch.setattr(snapshots, "_MAX_SHARE", math.inf)
    told: list[object] = []
    write = snapshots.Snapshots.write

    def noted(self: snapshots.Snapshots, *args: object, final: bool = False, **given: object):
        told.append("final" if final else "snapshot")
        return write(self, *args, final=final, **given)

    monkeypatch.setattr(snapshots.Snapshots, "write", noted)
    given = options(snapshot_seconds=1e-9)
    with Session(tmp_path / "out", given, on_event=told.append) as session:
        for photo in photos[:6]:
            session.add_extracted(photo)
        told.clear()
        session.finish()
    steps = [one.step if isinstance(one, FinishingBegan) else one for one in told]
    looked, adjusted = (
        steps.index(FinishingStep.LOOK_AGAIN),
        steps.index(FinishingStep.LAST_ADJUSTMENT),
    )
    assert looked < steps.index("snapshot") < adjusted < steps.index("final")


def test_after_one_that_took_very_long_the_next_does_not_wait_for_ever(tmp_path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(snapshots.time, "monotonic", lambda: now[0])
    (tmp_path / "out").mkdir()
    kept = snapshots.Snapshots(tmp_path / "out" / "sparse", 30.0)
    assert not kept.is_due
    now[0] = 100.0
    assert kept.is_due

    def sidecar(took_s: float) -> None:
        now[0] += took_s

    for took_s, waits_s in ((1.0, 30.0), (10.0, 200.0), (3600.0, 600.0)):
        kept.write([], 0, {}, {}, partial(sidecar, took_s))
        now[0] += waits_s - 1
        assert not kept.is_due
        now[0] += 2
        assert kept.is_due

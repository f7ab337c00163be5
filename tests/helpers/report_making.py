"""A finished output of a synthetic flight, with all its files, for tests of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pycolmap
from PIL import Image

from helpers.photo_stream import centre_of, described, true_pair
from sfm_front.evaluation.synthetic.scene import SyntheticScene, make_scene
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.accuracy import AxisResiduals, Outlier, ResidualSummary
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.sidecar import FILE_NAME, Sidecar, write_sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.reports.report_json import write_report
from sfm_front.reports.run_summary import (
    AuditOutcome,
    ModelOutcome,
    PhotoOutcome,
    RunSummary,
    Totals,
)
from sfm_front.storage.database import DATABASE, PhotoDatabase
from sfm_front.types import Exif, GeoPosition, Skipped, SkipReason

FRAME = LocalFrame(47.0, 8.0, 400.0)
WHY_NOT = "too few matches with any photo"
HINT = "take one between it and others"
# What pictures of the flight measure its photos to be, east, north and up of where they are.
OFFSET_M = (2.0, 1.0, -0.5)
METRIC = Sidecar(
    state=GeoreferenceState.METRIC,
    origin=FRAME,
    models_in_enu=(0,),
    residuals=ResidualSummary(
        num_used=7,
        east=AxisResiduals(2.0, 0.1, 2.01),
        north=AxisResiduals(1.0, 0.1, 1.01),
        up=AxisResiduals(-0.5, 0.1, 0.51),
        median_m=2.3,
        ce90_m=2.24,
        le90_m=0.52,
        outliers=(Outlier(2, 33.0),),
        bend=None,
    ),
    names={2: "far off.jpg"},
    left_out={"no fix.jpg": "at latitude and longitude 0"},
    flight=FlightFigures(gsd_cm_per_px=4.56, height_m=81.0, area_m2=12_345.0),
)


@dataclass(frozen=True, kw_only=True)
class Output:
    """``names`` of all photos in order; the last ``num_waiting`` are in no model. ``skipped``:
    name → reason. Without a ``sidecar`` there are no positions."""

    num_photos: int = 9
    num_waiting: int = 1
    names: Mapping[int, str] = field(default_factory=dict)
    skipped: Mapping[str, SkipReason] = field(default_factory=dict)
    sidecar: Sidecar | None = METRIC
    has_model: bool = True
    is_doubtful: bool = False
    why_not: str = WHY_NOT

    def name(self, index: int) -> str:
        return self.names.get(index, f"{index:06d}.jpg")

    @property
    def num_placed(self) -> int:
        return self.num_photos - self.num_waiting if self.has_model else 0


def finished_output(folder: Path, output: Output | None = None) -> Path:
    """Write it; returns ``folder``. Photos lie beside it, in ``photos``."""
    output = output or Output()
    scene = make_scene(output.num_photos, 300, seed=1)
    folder.mkdir(parents=True)
    photos = folder.parent / "photos"
    photos.mkdir(exist_ok=True)
    for name in output.skipped:
        Image.new("RGB", (60, 40), (200, 30, 30)).save(photos / name.replace("/", "_"), "PNG")
    _write_database(folder / DATABASE, photos, scene, output)
    if output.has_model:
        model = folder / "sparse" / "0"
        model.mkdir(parents=True)
        _model(scene, output).write_binary(model)
    if output.sidecar is not None:
        write_sidecar(folder / "sparse" / FILE_NAME, output.sidecar)
    write_report(folder, summary_of(output))
    return folder


def summary_of(output: Output) -> RunSummary:
    used = [
        PhotoOutcome(
            name=output.name(index),
            image_id=index + 1,
            model=0 if index < output.num_placed else None,
            why_not=None if index < output.num_placed else output.why_not,
            num_keypoints=300,
            most_relevant=output.name(index - 1) if index else None,
            num_verified=min(index, 1),
            num_rejected=0,
            placed=(),
            seconds={"sift": 0.5, "match": 0.1 * index, "map": 0.2, "refine": 0.05},
            events=(),
            hint="" if index < output.num_placed else HINT,
        )
        for index in range(output.num_photos)
    ]
    skipped = [Skipped(name, reason) for name, reason in output.skipped.items()]
    groups: tuple[tuple[str, ...], ...] = ((output.name(0),), (output.name(1),))
    doubtful = output.is_doubtful
    audit = AuditOutcome(20, 3 * doubtful, 0.1, doubtful, groups if doubtful else (), 0.1)
    models = [ModelOutcome("sparse/0", output.num_placed, 1234, 0.4321, 3.5, audit)]
    return RunSummary(
        photos=(*used, *skipped),
        models=tuple(models[: int(output.has_model)]),
        end_seconds={"finish": 1.5},
        end_events=("model 1 started: from images 1 and 2",),
        totals=Totals(
            num_photos=len(used) + len(skipped),
            num_used=len(used),
            num_registered=output.num_placed,
            num_points=1234 if output.has_model else 0,
            mean_reprojection_error_px=0.4321 if output.has_model else None,
            wall_seconds=65.0,
            seconds_by_stage={"sift": 4.0},
            median_seconds_by_quarter=(),
            peak_memory_bytes=None,
            latency=None,
        ),
        look_alikes=(groups,) if doubtful else (),
    )


def _write_database(file: Path, photos: Path, scene: SyntheticScene, output: Output) -> None:
    with PhotoDatabase(file) as database:
        for index in range(output.num_photos):
            name = output.name(index)
            position = measured(scene, index) if output.sidecar is not None else None
            photo = replace(
                described(scene, index),
                name=name,
                path=photos / name,
                exif=Exif(position=position),
            )
            # With its neighbour in the order of flight.
            pairs = [true_pair(scene, index, index - 1, (index + 1, index))] if index else []
            database.write(index + 1, photo, _said(scene.camera), pairs, prior=position)
        for name, reason in output.skipped.items():
            database.write_skipped(Skipped(name, reason), photos / name.replace("/", "_"))


def measured(scene: SyntheticScene, index: int) -> GeoPosition:
    """Where a photo's position says that it is: ``OFFSET_M`` from there."""
    there = centre_of(scene.cams_from_world[index]) + OFFSET_M
    return GeoPosition(*map(float, FRAME.to_wgs84(there[None])[0]))


def _said(camera: pycolmap.Camera) -> pycolmap.Camera:
    """The camera as EXIF has it: a tenth shorter."""
    said = pycolmap.Camera(camera.todict())
    said.params = [camera.params[0] * 0.9, *camera.params[1:]]
    said.has_prior_focal_length = True
    return said


def _model(scene: SyntheticScene, output: Output) -> pycolmap.Reconstruction:
    """The truth, with the keypoints that show its points."""
    model = pycolmap.Reconstruction()
    model.add_camera_with_trivial_rig(scene.camera)
    tracks: dict[int, list[tuple[int, int]]] = {}
    for index in range(output.num_placed):
        photo = scene.photo(index)
        model.add_image_with_trivial_frame(
            pycolmap.Image(
                name=output.name(index),
                keypoints=photo.features.keypoints[:, :2].astype(np.float64),
                camera_id=scene.camera.camera_id,
                image_id=index + 1,
            ),
            scene.cams_from_world[index],
        )
        for keypoint, point in enumerate(photo.point_ids.tolist()):
            if point >= 0:
                tracks.setdefault(point, []).append((index + 1, keypoint))
    for point, elements in tracks.items():
        if len(elements) > 1:
            track = pycolmap.Track([pycolmap.TrackElement(*element) for element in elements])
            model.add_point3D(scene.points[point], track, np.array([90, 140, 60], np.uint8))
    return model


def observed(model: pycolmap.Reconstruction, image_ids: Sequence[int]) -> set[tuple[int, int]]:
    """Image id and point id of every observation."""
    return {
        (image_id, point.point3D_id)
        for image_id in image_ids
        for point in model.images[image_id].get_observation_points2D()
    }

"""All that the page is made of, read from an output."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import pycolmap

from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.sidecar import FILE_NAME, Sidecar, read_sidecar
from sfm_front.photos.source import files_by_name
from sfm_front.reports import event_log
from sfm_front.reports.html import SCENE_FILE
from sfm_front.reports.html.observations import Observations, observations_of
from sfm_front.reports.report_json import read_report
from sfm_front.reports.run_summary import RunSummary
from sfm_front.storage.colmap_models import read_model
from sfm_front.storage.database import DATABASE
from sfm_front.storage.finished_session import FinishedSession, read_finished_session
from sfm_front.types import Float64Array


@dataclass(frozen=True, eq=False)
class Material:
    """What lies in ``output``.

    ``models`` as ``summary`` has them, the largest first; ``sidecar``: None without positions;
    ``files``: where photos are, those that were skipped, too, by name. ``has_scene``: whether the
    models to turn lie beside the page. ``began``: day and hour in
    UTC; ``version`` of the program that reconstructed. Both empty where nothing says so.
    """

    output: Path
    summary: RunSummary
    models: Sequence[pycolmap.Reconstruction]
    session: FinishedSession
    sidecar: Sidecar | None
    files: Mapping[str, Path]
    has_scene: bool = False
    began: str = ""
    version: str = ""

    @property
    def name(self) -> str:
        """That of the output's folder."""
        return self.output.resolve().name

    @cached_property
    def observations(self) -> Observations | None:
        """Of the largest model; None without any."""
        return self.observations_in(0) if self.models else None

    def observations_in(self, number: int) -> Observations:
        """Of the model of this number."""
        return observations_of(self.models[number], self.output / self.summary.models[number].path)

    @cached_property
    def names(self) -> dict[int, str]:
        """Of photos that were used, by image id."""
        return {photo.image_id: photo.name for photo in self.summary.used}

    @cached_property
    def num_pairs(self) -> Counter[int]:
        """Verified pairs of each photo, with earlier and with later ones, by image id."""
        return Counter(self.session.pairs[:, :2].ravel().tolist())

    @property
    def frame(self) -> LocalFrame | None:
        """That of the largest model if it is in east, north and up."""
        if self.sidecar is None or not self.models or 0 not in self.sidecar.models_in_enu:
            return None
        return self.sidecar.origin

    @property
    def flight(self) -> FlightFigures | None:
        """Of the largest model if it is in east, north and up, and its photos look down."""
        return None if self.sidecar is None or self.frame is None else self.sidecar.flight

    def measured_enu(self) -> dict[int, Float64Array]:
        """(3,) where positions say that photos are, in the frame; nan for an unknown height.

        By image id; empty without a frame.
        """
        frame = self.frame
        if frame is None:
            return {}
        positions = self.session.positions
        return dict(zip(positions, frame.to_enu(lat_lon_alt(positions.values())), strict=True))


def read_material(output: Path, photos: Path | None = None) -> Material:
    """``photos``: the folder of the photos, if they are no longer where they were.

    Raises InputError if ``output`` is not that of a finished run, a file of it cannot be read, or
    there is no such folder.
    """
    summary = read_report(output)
    session = read_finished_session(output / DATABASE)
    files = {**session.skipped, **{photo.name: photo.path for photo in session.photos}}
    if photos is not None:
        files = files_by_name(photos)
    sidecar = output / "sparse" / FILE_NAME
    began, version = _beginning(output)
    return Material(
        output=output,
        summary=summary,
        models=[read_model(output / model.path) for model in summary.models],
        session=session,
        sidecar=read_sidecar(sidecar) if sidecar.is_file() else None,
        files=files,
        has_scene=(output / SCENE_FILE).is_file(),
        began=began,
        version=version,
    )


def _beginning(output: Path) -> tuple[str, str]:
    """When the session began, and the program's version, as its first event says."""
    try:
        with (output / event_log.FILE).open(encoding="utf-8") as lines:
            first = json.loads(lines.readline())
        return str(first["time"])[:16].replace("T", " "), str(first["version"])
    except (OSError, ValueError, KeyError, TypeError):
        return "", ""

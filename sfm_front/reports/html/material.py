"""All that the page is made of."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import pycolmap

from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.georeference.flight_figures import FlightFigures
from sfm_front.georeference.sidecar import Sidecar
from sfm_front.reports.html.observations import Observations, observations_of
from sfm_front.reports.run_summary import RunSummary
from sfm_front.storage.stored_session import StoredSession
from sfm_front.types import Float64Array


@dataclass(frozen=True, eq=False)
class Material:
    """What lies in ``output``.

    ``models`` as ``summary`` has them, the largest first; ``sidecar``: None without positions;
    ``files``: where photos are, those that were skipped, too, by name. ``has_scene``: whether the
    models to turn lie beside the page. ``began``: day and hour in
    UTC; ``version`` of the program that reconstructed. Both empty where nothing says so.
    ``how_it_stands``: of a session that has not ended, or was stopped; empty of any other.
    ``command``: what goes on with it, empty where that is not known.
    ``observed``: what its models see, by their numbers, for their files may be replaced.
    """

    output: Path
    summary: RunSummary
    models: Sequence[pycolmap.Reconstruction]
    session: StoredSession
    sidecar: Sidecar | None
    files: Mapping[str, Path]
    has_scene: bool = False
    began: str = ""
    version: str = ""
    how_it_stands: str = ""
    command: str = ""
    is_finished: bool = True
    is_running: bool = False
    observed: Mapping[int, Observations] = field(default_factory=dict)

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
        if number in self.observed:
            return self.observed[number]
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

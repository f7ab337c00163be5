"""What a finished session says of itself; writers make JSON and text of it."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from sfm_front.reports.camera_outcome import CameraOutcome
from sfm_front.reports.cluster_outcome import ClusterOutcome
from sfm_front.types import Skipped, WaitingReason

if TYPE_CHECKING:  # The command line reads this before anything heavy may be loaded.
    from sfm_front.georeference.control.report import ControlReport
    from sfm_front.georeference.sidecar import Sidecar


@dataclass(frozen=True, slots=True)
class PhotoOutcome:
    """What became of a photo that was used.

    ``model``: number of the largest model that holds it; if None, ``why_not`` says why, and
    ``hint`` what would help. ``waiting``: of what kind that reason is; None in reports of earlier
    versions, and where it is of no kind.
    ``num_verified`` and ``num_rejected`` count its pairs with earlier photos. ``placed`` names the
    photos that were registered when it arrived. ``seconds`` is by stage; ``events`` are in words.
    """

    name: str
    image_id: int
    model: int | None
    why_not: str | None
    num_keypoints: int
    most_relevant: str | None
    num_verified: int
    num_rejected: int
    placed: tuple[str, ...]
    seconds: dict[str, float]
    events: tuple[str, ...]
    hint: str = ""
    waiting: WaitingReason | None = None


@dataclass(frozen=True, slots=True)
class AuditOutcome:
    """``num_contradicted`` of ``num_pairs`` verified pairs contradict a model's poses, with
    ``contradicted_share`` of all matches; ``is_doubtful`` if that is more than sound models have.

    ``worst_groups``: names of the photos of two parts of the model, the larger first, of whose
    matches the largest share, ``worst_share``, contradicts it; empty if no pair does.
    """

    num_pairs: int
    num_contradicted: int
    contradicted_share: float
    is_doubtful: bool
    worst_groups: tuple[tuple[str, ...], ...]
    worst_share: float


@dataclass(frozen=True, slots=True)
class ModelOutcome:
    """A finished model; ``path`` is relative to the output. ``audit``: how far the verified pairs
    of its photos agree with it; None in reports of earlier versions."""

    path: str
    num_registered: int
    num_points: int
    mean_reprojection_error_px: float
    mean_track_length: float
    audit: AuditOutcome | None


@dataclass(frozen=True, slots=True)
class Latency:
    """How long photos took, in seconds; 95 % of them took ``p95_s`` or less."""

    median_s: float
    p95_s: float
    worst_s: float

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Latency | None:
        """None if there are none."""
        if not seconds:
            return None
        ordered = sorted(seconds)
        # Nearest rank: one of the photos did take so long.
        p95_s = ordered[math.ceil(0.95 * len(ordered)) - 1]
        return cls(statistics.median(ordered), p95_s, ordered[-1])


@dataclass(frozen=True, slots=True)
class Totals:
    """The whole session in numbers.

    ``median_seconds_by_quarter``: work on a photo in its turn, see ``run_report``.

    ``latency``: from arrival to the first pose, of the photos that this run took in and placed, at
    its end too; None if there are none. A photo of a watched folder arrives when it is taken up:
    its file has rested by then, and the session is free to look. One of a folder given at once
    arrives when it is read ahead, so this says little of how fast a new photo would be placed.
    """

    num_photos: int
    num_used: int
    num_registered: int
    num_points: int
    mean_reprojection_error_px: float | None
    wall_seconds: float
    seconds_by_stage: dict[str, float]
    median_seconds_by_quarter: tuple[float, ...]
    peak_memory_bytes: int | None
    latency: Latency | None


@dataclass(frozen=True, slots=True, kw_only=True)
class GeoreferenceOutcome:
    """What measured positions say of the models.

    ``sidecar``: as ``georeference.json`` has it; None if no photo has a position and there are no
    control points, or nobody wants to know. ``num_unused_rows`` of a file of positions name no
    photo. ``kept_positions``: whether the last adjustment of the largest model used them; False if
    they and the photos contradict each other, None if they were not tried.
    """

    sidecar: Sidecar | None
    num_unused_rows: int = 0
    kept_positions: bool | None = None


Outcome: TypeAlias = Skipped | PhotoOutcome


@dataclass(frozen=True, slots=True)
class RunSummary:
    """Photos in order of arrival, models largest first, and how the session ended.

    ``end_events`` are those of idle times, too. ``look_alikes``: names of the photos of two groups
    that show things that look alike, each time a model was taken apart for it. ``georeference``:
    None where nothing is known of positions. ``cameras``: of each model. ``cluster``: what its
    workers did; None in a session of one process.
    """

    photos: tuple[Outcome, ...]
    models: tuple[ModelOutcome, ...]
    end_seconds: dict[str, float]
    end_events: tuple[str, ...]
    totals: Totals
    look_alikes: tuple[tuple[tuple[str, ...], ...], ...] = ()
    georeference: GeoreferenceOutcome | None = None
    cameras: tuple[CameraOutcome, ...] = ()
    cluster: ClusterOutcome | None = None

    @property
    def sidecar(self) -> Sidecar | None:
        """Where the models stand on the earth; None where there are no positions."""
        return self.georeference.sidecar if self.georeference else None

    @property
    def control_points(self) -> ControlReport | None:
        """What became of them; None if none were given."""
        return self.sidecar.control_points if self.sidecar else None

    @property
    def used(self) -> list[PhotoOutcome]:
        """Photos that were not skipped."""
        return [photo for photo in self.photos if isinstance(photo, PhotoOutcome)]

    @property
    def skipped(self) -> list[Skipped]:
        """Photos that were."""
        return [photo for photo in self.photos if isinstance(photo, Skipped)]

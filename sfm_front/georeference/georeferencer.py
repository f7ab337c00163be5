"""A frame of the earth for a model that grows: found once, and held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from typing import Any

import numpy as np
import pycolmap

from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.geometry.similarity import Similarities
from sfm_front.georeference.alignment import Alignment, align
from sfm_front.georeference.anchors import Anchors, camera_centres
from sfm_front.georeference.consensus import Floor, agreeing
from sfm_front.georeference.fixes import Fixes
from sfm_front.georeference.spread import GeoreferenceState, SpreadOptions, Verdict, judge
from sfm_front.mapping.position_priors import PositionPriors
from sfm_front.types import GeoPosition

# A new estimate contradicts what was said if half the cameras move further than so many standard
# deviations of both.
_CONTRADICTION = 3.0
# Cameras that must have been there before.
_MIN_COMMON = 3
# Standard deviation of a height that is not known, where a number is asked for.
_UNKNOWN_M = 1e5


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoPosition:
    """A photo's position that is fit for use, with its standard deviations in metres.

    ``flight``: photos of one number share what their heights are measured from.
    """

    position: GeoPosition
    horizontal_sigma_m: float
    vertical_sigma_m: float
    captured_at: datetime | None = None
    flight: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Georeference:
    """Where a model stands on the earth.

    ``frame``: None until a model was aligned. ``alignment``: of the model as it was given, None in
    state NONE; its rows, those of ``fixes`` and the poses ``cam_from_model`` belong to the photos
    ``image_ids``. ``reasons``: as in ``Verdict``.
    ``held``: the newest estimate is not taken, and the reason says why; the frame is where it was.
    """

    state: GeoreferenceState = GeoreferenceState.NONE
    frame: LocalFrame | None = None
    alignment: Alignment | None = None
    fixes: Fixes | None = None
    image_ids: tuple[int, ...] = ()
    cam_from_model: tuple[pycolmap.Rigid3d, ...] = ()
    reasons: tuple[str, ...] = ()
    held: bool = False

    @property
    def priors(self) -> PositionPriors:
        """The positions that are right, in ENU: heights as if all flights began at one, standard
        deviations as large as the residuals say. None before there is an alignment."""
        alignment, fixes = self.alignment, self.fixes
        if alignment is None or fixes is None:
            return PositionPriors({}, {})
        sigmas = np.sqrt(alignment.floor.variances(fixes))
        raised = fixes.raised(alignment.height_offsets)
        rows = np.flatnonzero(alignment.inliers).tolist()
        return PositionPriors(
            {self.image_ids[row]: raised.enu[row] for row in rows},
            {self.image_ids[row]: np.minimum(sigmas[row], _UNKNOWN_M) for row in rows},
        )

    @property
    def in_enu(self) -> Georeference:
        """The same of the model once it has been moved by the alignment."""
        alignment = self.alignment
        if alignment is None:
            return self
        moved = alignment.enu_from_model
        return replace(
            self,
            alignment=replace(alignment, enu_from_model=pycolmap.Sim3d()),
            cam_from_model=tuple(moved.transform_camera_world(p) for p in self.cam_from_model),
        )


class Georeferencer:
    """Says after each photo where the model stands.

    The origin is fixed with the first alignment. Once metric, a frame is held: later estimates
    refine it by what their uncertainty allows, and one that contradicts is named and not taken. A
    model that shares no photos with the one that was metric is judged afresh, in the same frame.
    """

    def __init__(self, options: SpreadOptions | None = None, seed: int = 0) -> None:
        self._options = options or SpreadOptions()
        self._seed = seed
        self._frame: LocalFrame | None = None
        self._anchors: Anchors | None = None

    def update(
        self,
        cam_from_model: Mapping[int, pycolmap.Rigid3d],
        positions: Mapping[int, PhotoPosition],
    ) -> Georeference:
        """The georeference of the model that the frame is held by, the largest.

        ``cam_from_model``: poses of its cameras as they were held (turned by EXIF's orientation)
        by image id, in any frame. ``positions`` by image id, of these and other photos.
        """
        found = self.look_at(cam_from_model, positions)
        alignment = found.alignment
        if alignment and found.state is GeoreferenceState.METRIC and not found.held:
            self._anchors = Anchors.of(alignment, cam_from_model)
        return found

    def look_at(
        self,
        cam_from_model: Mapping[int, pycolmap.Rigid3d],
        positions: Mapping[int, PhotoPosition],
    ) -> Georeference:
        """The same of any model: nothing is remembered but the frame, if it is the first."""
        ids = _in_order(cam_from_model, positions)
        found = [positions[image_id] for image_id in ids]
        poses = [cam_from_model[image_id] for image_id in ids]
        if not ids:
            return Georeference(frame=self._frame, reasons=("no photo has a position",))
        frame = self._frame or _frame_at(found)
        fixes = _fixes(found, frame)
        alignment = self._align(poses, fixes)
        if self._frame is None and alignment is not None:
            self._frame = frame = _frame_at(
                [one for one, right in zip(found, alignment.inliers, strict=True) if right]
            )
            fixes = _fixes(found, frame)
            alignment = self._align(poses, fixes)
        verdict = judge(alignment, fixes, self._options)
        common = self._anchors.common(cam_from_model) if self._anchors else []
        refused = ""
        if self._anchors is not None and len(common) >= _MIN_COMMON:
            refused = _why_not(self._anchors, alignment, verdict, cam_from_model, common)
            if refused:
                alignment = _held(self._anchors, alignment, cam_from_model, common, poses, fixes)
                verdict = Verdict(GeoreferenceState.METRIC, (refused,))
        return Georeference(
            state=verdict.state,
            frame=self._frame,
            alignment=alignment,
            fixes=fixes,
            image_ids=tuple(ids),
            cam_from_model=tuple(poses),
            reasons=verdict.reasons,
            held=bool(refused),
        )

    @property
    def frame(self) -> LocalFrame | None:
        """Where positions have fixed the origin."""
        return self._frame

    def compare(
        self,
        cam_from_enu: Mapping[int, pycolmap.Rigid3d],
        positions: Mapping[int, PhotoPosition],
        frame: LocalFrame,
        reason: str,
    ) -> Georeference:
        """Positions beside a model in this frame that something better holds, which is the
        ``reason`` why it is metric: they do not move it, and nothing of this is remembered."""
        ids = _in_order(cam_from_enu, positions)
        poses = [cam_from_enu[image_id] for image_id in ids]
        metric = Georeference(state=GeoreferenceState.METRIC, frame=frame, reasons=(reason,))
        if not ids:
            return metric
        fixes = _fixes([positions[image_id] for image_id in ids], frame)
        alignment = self._align(poses, fixes)
        if alignment is None:
            return metric
        raised = fixes.raised(alignment.height_offsets)
        residuals = np.where(fixes.known, raised.enu - camera_centres(poses), np.nan)
        stays = replace(alignment, enu_from_model=pycolmap.Sim3d(), residuals=residuals)
        return replace(
            metric,
            alignment=stays,
            fixes=fixes,
            image_ids=tuple(ids),
            cam_from_model=tuple(poses),
        )

    def as_json(self) -> dict[str, Any]:
        """What a resumed session needs to hold the frame; read by ``restore``."""
        frame = self._frame
        return {
            "frame": frame and [frame.latitude_deg, frame.longitude_deg, frame.altitude_m],
            "anchors": self._anchors and self._anchors.as_json(),
        }

    def restore(self, row: Mapping[str, Any]) -> None:
        """Go on from what ``as_json`` gave. Raises KeyError, TypeError or ValueError for less."""
        self._frame = LocalFrame(*row["frame"]) if row["frame"] else None
        self._anchors = Anchors.of_json(row["anchors"]) if row["anchors"] else None

    def _align(self, poses: Sequence[pycolmap.Rigid3d], fixes: Fixes) -> Alignment | None:
        attitudes = np.array([pose.rotation.matrix() for pose in poses])
        return align(camera_centres(poses), fixes, attitudes, self._seed)


def _why_not(
    anchors: Anchors,
    alignment: Alignment | None,
    verdict: Verdict,
    cam_from_model: Mapping[int, pycolmap.Rigid3d],
    common: Sequence[int],
) -> str:
    """Why the newest estimate is not taken, or nothing."""
    if alignment is None or verdict.state is not GeoreferenceState.METRIC:
        return f"the frame is held: by itself the newest estimate says {'; '.join(verdict.reasons)}"
    before = anchors.centres(common)
    centres = camera_centres([cam_from_model[image_id] for image_id in common])
    moves = alignment.enu_from_model * centres - before
    sigmas = np.hypot(anchors.sigmas_m(before), alignment.position_sigmas_m(centres))
    times = float(np.median(np.max(np.abs(moves) / sigmas, axis=1)))
    if times <= _CONTRADICTION:
        return ""
    metres = float(np.median(np.linalg.norm(moves, axis=1)))
    return (
        f"the frame is held: the newest positions would move it by {metres:.1f} m, "
        f"{times:.0f} times its uncertainty"
    )


def _held(
    anchors: Anchors,
    alignment: Alignment | None,
    cam_from_model: Mapping[int, pycolmap.Rigid3d],
    common: Sequence[int],
    poses: Sequence[pycolmap.Rigid3d],
    fixes: Fixes,
) -> Alignment:
    """The alignment that leaves the cameras where they were."""
    enu_from_model = anchors.enu_from(cam_from_model, common)
    floor = alignment.floor if alignment else Floor(0.0, 0.0)
    offsets = alignment.height_offsets if alignment else {}
    centres, raised = camera_centres(poses), fixes.raised(offsets)
    similarity = Similarities.of([enu_from_model])
    return Alignment(
        enu_from_model=enu_from_model,
        inliers=agreeing(similarity, centres, raised, floor),
        residuals=np.where(fixes.known, raised.enu - similarity(centres)[0], np.nan),
        floor=floor,
        pivot=anchors.pivot,
        covariance=anchors.covariance,
        positions_only=anchors.positions_only,
        height_offsets=offsets,
    )


def _in_order(
    cam_from_model: Mapping[int, pycolmap.Rigid3d], positions: Mapping[int, PhotoPosition]
) -> list[int]:
    """The photos with a position, as they were taken."""
    ids = [image_id for image_id in cam_from_model if image_id in positions]
    return sorted(ids, key=lambda image_id: _order(image_id, positions[image_id]))


def _order(image_id: int, position: PhotoPosition) -> tuple[int, float, int]:
    """Photos as they were taken, flight by flight; by id where nobody knows when."""
    when = position.captured_at
    # Cameras have no time zone: read as if in UTC, no hour is missing or there twice.
    seconds = when.replace(tzinfo=timezone.utc).timestamp() if when else 0.0
    return position.flight, seconds, image_id


def _frame_at(positions: Sequence[PhotoPosition]) -> LocalFrame:
    """At the first of them whose altitude is known, else at the first with altitude 0."""
    known = [one.position for one in positions if one.position.altitude_m is not None]
    origin = known[0] if known else positions[0].position
    return LocalFrame(origin.latitude_deg, origin.longitude_deg, origin.altitude_m or 0.0)


def _fixes(positions: Sequence[PhotoPosition], frame: LocalFrame) -> Fixes:
    enu = frame.to_enu(lat_lon_alt(one.position for one in positions))
    sigmas = np.array(
        [
            (one.horizontal_sigma_m, one.horizontal_sigma_m, one.vertical_sigma_m)
            for one in positions
        ]
    )
    return Fixes.of(enu, sigmas, np.array([one.flight for one in positions]))

"""A session on a scene with GPS, photo by photo: from when on it is metric, and how well."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from sfm_front.evaluation.georeference.moves import FirstSaid, Move
from sfm_front.evaluation.gps import (
    free_fit,
    gps_residual_as_it_stands_m,
    gps_residual_m,
)
from sfm_front.evaluation.tuning.trials import Described
from sfm_front.georeference.georeferencer import Georeference
from sfm_front.georeference.sidecar import FILE_NAME, Sidecar, read_sidecar
from sfm_front.georeference.spread import GeoreferenceState
from sfm_front.photos.position_checks import check_positions
from sfm_front.session.options import SessionOptions
from sfm_front.session.session import Session
from sfm_front.storage.colmap_models import read_model
from sfm_front.types import GeoPosition, Skipped

if TYPE_CHECKING:
    import pycolmap


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """What was said after a photo. ``move``: since it was metric first; None before."""

    state: str
    scale_sigma: float | None
    move: Move | None


@dataclass(frozen=True, slots=True, kw_only=True)
class GeoreferenceTrial:
    """One session.

    ``steps``: after each photo, and at the end. ``first_metric``: number of the photo, counted from
    1, after which the model was metric; None if it never was. ``registered`` in the largest model.
    ``as_it_stands_m``: median distance of its cameras from GPS, without another fit, None unless it
    is in ENU; ``free_fit_m``: after the similarity that fits best. ``scale_ratio``: of the largest
    model to that of the free fit. ``bend_share``: of the extent. ``reasons``: the sidecar's.
    """

    scene: str
    photos: int
    registered: int
    state: str
    first_metric: int | None
    as_it_stands_m: float | None
    free_fit_m: float | None
    scale_ratio: float | None
    bend_share: float | None
    reasons: tuple[str, ...]
    steps: tuple[Step, ...]

    @property
    def largest_move(self) -> Move | None:
        """The largest of each kind; None if it never was metric, or not before the end."""
        moves = [step.move for step in self.steps if step.move is not None]
        return Move.largest(moves) if moves else None


def run_trial(
    scene: str, described: Sequence[Described], options: SessionOptions, count: Callable[[], None]
) -> GeoreferenceTrial:
    """One session over the photos in this order. ``count`` is called for each photo."""
    steps: list[Step] = []
    first: FirstSaid | None = None
    with TemporaryDirectory(prefix="sfm_front_georeference_") as folder:
        with Session(Path(folder), options) as session:
            for photo in described:
                session.add_extracted(photo)
                steps.append(_step(session.georeference, first))
                if first is None and _is_metric(session.georeference):
                    first = FirstSaid.of(session.georeference)
                count()
            models = [model.path for model in session.finish().models]
            steps.append(_step(session.georeference, first))
        sidecar = read_sidecar(Path(folder) / "sparse" / FILE_NAME) if models else None
        largest = read_model(models[0]) if models else None
    states = [step.state for step in steps[:-1]]
    metric = GeoreferenceState.METRIC.value
    residuals = sidecar.residuals if sidecar else None
    bend = residuals.bend if residuals else None
    as_it_stands_m, free_fit_m, scale_ratio = _against_gps(largest, sidecar, _usable(described))
    return GeoreferenceTrial(
        scene=scene,
        photos=len(described),
        registered=largest.num_reg_images() if largest else 0,
        state=sidecar.state.value if sidecar else GeoreferenceState.NONE.value,
        first_metric=states.index(metric) + 1 if metric in states else None,
        as_it_stands_m=as_it_stands_m,
        free_fit_m=free_fit_m,
        scale_ratio=scale_ratio,
        bend_share=bend.share_of_extent if bend else None,
        reasons=sidecar.reasons if sidecar else (),
        steps=tuple(steps),
    )


def _is_metric(georeference: Georeference) -> bool:
    return georeference.state is GeoreferenceState.METRIC


def _step(now: Georeference, first: FirstSaid | None) -> Step:
    return Step(
        state=now.state.value,
        scale_sigma=now.alignment.scale_sigma if now.alignment else None,
        move=first.move_to(now) if first else None,
    )


def _against_gps(
    model: pycolmap.Reconstruction | None,
    sidecar: Sidecar | None,
    positions: Mapping[str, GeoPosition],
) -> tuple[float | None, float | None, float | None]:
    """Metres as the model stands, metres after the free fit, and the ratio of both scales."""
    if model is None:
        return None, None, None
    free_fit_m = gps_residual_m(model, positions)
    if sidecar is None or sidecar.origin is None or 0 not in sidecar.models_in_enu:
        return None, free_fit_m, None
    fitted = free_fit(model, positions, sidecar.origin)
    return (
        gps_residual_as_it_stands_m(model, positions, sidecar.origin),
        free_fit_m,
        1 / float(fitted.scale) if fitted else None,
    )


def _usable(described: Sequence[Described]) -> dict[str, GeoPosition]:
    """By name of the photo: what EXIF has, without what cannot be."""
    found = {
        number: photo.exif.position
        for number, photo in enumerate(described)
        if not isinstance(photo, Skipped) and photo.exif.position is not None
    }
    return {described[number].name: p for number, p in check_positions(found).usable.items()}

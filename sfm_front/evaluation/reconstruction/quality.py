"""The quality of a run's models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from sfm_front.evaluation.gps import gps_residual_m
from sfm_front.evaluation.poses import auc, pose_errors
from sfm_front.evaluation.reconstruction.scenes import BenchmarkScene
from sfm_front.photos.exif import read_exif
from sfm_front.storage.colmap_models import read_model

if TYPE_CHECKING:
    import pycolmap


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """``registered`` counts the photos in the largest model, ``registered_in_all`` those in any.

    ``points`` and ``reprojection_error_px`` are over all models. ``auc`` is that of the pose
    errors at 1, 3 and 5 degrees, in [0, 1]; None without ground truth. ``pairs_joined`` is the
    fraction of the pairs known to overlap with both photos in one model; None if none are known.
    ``mixed`` counts models with photos of several landmarks; None if these are not known.
    ``gps_residual_m`` is that of the largest model; None without GPS.
    """

    registered: int
    registered_in_all: int
    models: int
    points: int
    reprojection_error_px: float | None
    auc: tuple[float, ...] | None
    pairs_joined: float | None
    mixed: int | None
    gps_residual_m: float | None


def assess(folders: Sequence[Path], scene: BenchmarkScene) -> Quality:
    """Assess the models in ``folders`` against the ground truth of ``scene``."""
    models = [read_model(folder) for folder in folders]
    names = [_names(model) for model in models]
    points = sum(model.num_points3D() for model in models)
    return Quality(
        registered=max(map(len, names), default=0),
        registered_in_all=len(set().union(*names)),
        models=len(models),
        points=points,
        reprojection_error_px=_reprojection_error_px(models) if points else None,
        auc=_auc(models, scene),
        pairs_joined=_pairs_joined(names, scene),
        mixed=_mixed(names, scene),
        gps_residual_m=_gps_residual_m(models, scene),
    )


def _names(model: pycolmap.Reconstruction) -> set[str]:
    return {model.images[image_id].name.casefold() for image_id in model.reg_image_ids()}


def _reprojection_error_px(models: Sequence[pycolmap.Reconstruction]) -> float:
    """Mean over points of the mean over their observations, as COLMAP prints it.

    Recomputed: a model on disk may have been transformed since its errors were written.
    """
    for model in models:
        model.update_point_3d_errors()
    points = sum(model.num_points3D() for model in models)
    errors = (model.compute_mean_reprojection_error() * model.num_points3D() for model in models)
    return float(sum(errors)) / points


def _auc(
    models: Sequence[pycolmap.Reconstruction], scene: BenchmarkScene
) -> tuple[float, ...] | None:
    if scene.truth is None:
        return None
    errors = pose_errors(read_model(scene.truth), models, scene.pairs)
    return tuple(auc(errors)) if len(errors) else None


def _pairs_joined(names: Sequence[set[str]], scene: BenchmarkScene) -> float | None:
    if not scene.pairs:
        return None
    joined = sum(
        any(first.casefold() in model and second.casefold() in model for model in names)
        for first, second in scene.pairs
    )
    return joined / len(scene.pairs)


def _mixed(names: Sequence[set[str]], scene: BenchmarkScene) -> int | None:
    if scene.landmarks is None:
        return None
    landmarks = scene.landmarks
    return sum(len({landmarks[name] for name in model}) > 1 for model in names)


def _gps_residual_m(
    models: Sequence[pycolmap.Reconstruction], scene: BenchmarkScene
) -> float | None:
    if not models:
        return None
    largest = max(models, key=lambda model: model.num_reg_images())
    names = [largest.images[image_id].name for image_id in largest.reg_image_ids()]
    positions = {name: read_exif(scene.photos / name).position for name in names}
    return gps_residual_m(
        largest, {name: p for name, p in positions.items() if p is not None and p.is_fix}
    )

"""Models → ``sparse/0``, ``sparse/1``, …: COLMAP files and coloured PLY point clouds."""

from __future__ import annotations

import logging
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pycolmap

from sfm_front.types import ModelSummary, Uint8Array

logger = logging.getLogger(__name__)

# What C++ takes for white space: COLMAP reads a name in a text model up to the first of it.
_WHITE_SPACE = re.compile(r"[ \t\n\v\f\r]")


def first_name_lost_in_text(names: Iterable[str]) -> str | None:
    """The first photo name that COLMAP's text form cannot keep; None if it keeps them all."""
    return next((name for name in names if _WHITE_SPACE.search(name)), None)


def export_models(
    reconstructions: Sequence[pycolmap.Reconstruction],
    colors: Mapping[int, Uint8Array],
    folder: Path,
    *,
    text: bool = False,
) -> list[ModelSummary]:
    """Colour models and write them to ``folder/0``, ``folder/1``, … in the order given.

    ``colors``: image id → (N, 3) uint8 RGB of its keypoints. ``text`` adds COLMAP's text form,
    but not to a model with a photo whose name it cannot keep: a warning names the photo.
    Everything is written beside ``folder`` first and then moved into place, so that a crash
    leaves either the models that were there or the new ones, never a part. Where it happens
    between the two moves, the models that were there are in ``folder.old``.
    """
    fresh = folder.with_name(folder.name + ".new")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    summaries = []
    for number, reconstruction in enumerate(reconstructions):
        _color(reconstruction, colors)
        model = fresh / str(number)
        model.mkdir()
        reconstruction.write_binary(model)
        if text:
            _write_text(reconstruction, model)
        reconstruction.export_PLY(model / "points3D.ply")
        summaries.append(
            ModelSummary(
                path=folder / str(number),
                reconstruction=reconstruction,
                num_registered=int(reconstruction.num_reg_images()),
                num_points=int(reconstruction.num_points3D()),
                mean_reprojection_error_px=float(reconstruction.compute_mean_reprojection_error()),
                mean_track_length=float(reconstruction.compute_mean_track_length()),
            )
        )
    _replace(folder, fresh)
    return summaries


def _write_text(reconstruction: pycolmap.Reconstruction, folder: Path) -> None:
    lost = first_name_lost_in_text(image.name for image in reconstruction.images.values())
    if lost is None:
        reconstruction.write_text(folder)
    else:
        logger.warning("no model as text: COLMAP would cut the name %r at its white space", lost)


def _replace(folder: Path, fresh: Path) -> None:
    old = folder.with_name(folder.name + ".old")
    if folder.exists():
        shutil.rmtree(old, ignore_errors=True)
        folder.rename(old)
    fresh.rename(folder)
    shutil.rmtree(old, ignore_errors=True)


def _color(reconstruction: pycolmap.Reconstruction, colors: Mapping[int, Uint8Array]) -> None:
    """Give each point the mean colour of the keypoints in its track."""
    for point in reconstruction.points3D.values():
        seen = [colors[e.image_id][e.point2D_idx] for e in point.track.elements]
        point.color = np.mean(seen, axis=0).round().astype(np.uint8)

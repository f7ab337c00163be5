"""Models → ``sparse/0``, ``sparse/1``, …: COLMAP files and coloured PLY point clouds."""

from __future__ import annotations

import errno
import logging
import os
import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pycolmap

from sfm_front.errors import StorageError
from sfm_front.georeference.sidecar import FILE_NAME, Sidecar, write_sidecar
from sfm_front.storage.atomic import sync
from sfm_front.storage.json_files import write_json
from sfm_front.storage.written_models import STATE, file_size, file_sizes
from sfm_front.types import ModelSummary, Uint8Array

POINT_CLOUD = "points3D.ply"
"""The coloured points, beside a model."""

logger = logging.getLogger(__name__)

# What C++ takes for white space: COLMAP reads a name in a text model up to the first of it.
_WHITE_SPACE = re.compile(r"[ \t\n\v\f\r]")


def first_name_lost_in_text(names: Iterable[str]) -> str | None:
    """The first photo name that COLMAP's text form cannot keep; None if it keeps them all."""
    return next((name for name in names if _WHITE_SPACE.search(name)), None)


def export_models(
    reconstructions: Sequence[pycolmap.Reconstruction],
    colors: Mapping[int, Uint8Array] | None,
    folder: Path,
    *,
    text: bool = False,
    point_clouds: bool = True,
    state: Mapping[str, object] | None = None,
    sidecar: Sidecar | None = None,
) -> list[ModelSummary]:
    """Colour models and write them to ``folder/0``, ``folder/1``, … in the order given.

    ``colors``: image id → (N, 3) uint8 RGB of its keypoints; None if the points have their colours
    already. ``text`` adds COLMAP's text form,
    ``point_clouds`` PLY files, ``state`` a JSON file with this content and the files' sizes,
    ``sidecar`` a ``georeference.json``. A
    model with a photo whose name text cannot keep gets no text: a warning names the photo.
    Everything is written beside ``folder`` first, synced, and then moved into place, so that a
    crash leaves either the models that were there or the new ones, never a part. If it happens
    between the two moves, ``recover_models`` completes them. Raises StorageError if the disk is
    full or cannot be written to; the models that were there stay.
    """
    try:
        return _export(reconstructions, colors, folder, text, point_clouds, state, sidecar)
    except OSError as error:
        raise StorageError(
            f"{folder}: models cannot be written ({error.strerror or error})."
        ) from error


def recover_models(folder: Path) -> None:
    """Complete what a crash between the two moves of ``export_models`` left."""
    fresh, old = _beside(folder)
    if not folder.exists() and old.exists() and fresh.exists():
        fresh.rename(folder)
    if not folder.exists() and old.exists():
        old.rename(folder)
    for leftover in (fresh, old):
        shutil.rmtree(leftover, ignore_errors=True)


def _export(
    reconstructions: Sequence[pycolmap.Reconstruction],
    colors: Mapping[int, Uint8Array] | None,
    folder: Path,
    text: bool,
    point_clouds: bool,
    state: Mapping[str, object] | None,
    sidecar: Sidecar | None,
) -> list[ModelSummary]:
    fresh, _ = _beside(folder)
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    summaries = []
    for number, reconstruction in enumerate(reconstructions):
        if colors is not None:
            color_points(reconstruction, colors, reconstruction.point3D_ids())
        model = fresh / str(number)
        model.mkdir()
        reconstruction.write_binary(model)
        if text:
            _write_text(reconstruction, model)
        if point_clouds:
            reconstruction.export_PLY(model / POINT_CLOUD)
        check_written(reconstruction, model)
        summaries.append(ModelSummary.of(reconstruction, folder / str(number)))
    if sidecar is not None:
        write_sidecar(fresh / FILE_NAME, sidecar)
    if state is not None:
        write_json(fresh / STATE, {**state, "files": file_sizes(fresh)})
    _sync_all(fresh)
    _replace(folder)
    return summaries


def _beside(folder: Path) -> tuple[Path, Path]:
    """Where new models are written, and old ones wait to be removed."""
    return folder.with_name(folder.name + ".new"), folder.with_name(folder.name + ".old")


def check_written(model: pycolmap.Reconstruction, folder: Path, *, binary: bool = True) -> None:
    """Raise OSError unless what pycolmap wrote of ``model`` to ``folder`` is whole: its ``binary``
    form, else text, and text and PLY wherever they are there.

    pycolmap does not tell when a disk or a quota was full: compare what there should be. The small
    files are written before the large ones and would not have fitted less.
    """
    whole = True
    # colmap.github.io/format.html, and 15 bytes a point in a PLY file.
    if binary:
        images = 8 + sum(
            4 + 56 + 4 + len(os.fsencode(image.name)) + 1 + 8 + 24 * image.num_points2D()
            for image in map(model.image, model.reg_image_ids())
        )
        points = 8 + 51 * model.num_points3D() + 8 * model.compute_num_observations()
        whole = (
            file_size(folder / "images.bin") == images
            and file_size(folder / "points3D.bin") == points
        )
    cloud = folder / POINT_CLOUD
    if whole and cloud.exists():
        _, end, data = cloud.read_bytes().partition(b"end_header\n")
        whole = bool(end) and len(data) == 15 * model.num_points3D()
    if whole and (not binary or (folder / "points3D.txt").exists()):
        whole = _is_whole_text(model, folder)
    if not whole:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _is_whole_text(model: pycolmap.Reconstruction, folder: Path) -> bool:
    found = pycolmap.Reconstruction()
    try:
        found.read_text(folder)
    except (ValueError, RuntimeError, IndexError, MemoryError):
        return False
    same_points = found.num_points3D() == model.num_points3D()
    return same_points and found.compute_num_observations() == model.compute_num_observations()


def _sync_all(folder: Path) -> None:
    for path in folder.rglob("*"):
        sync(path)
    sync(folder)


def _write_text(reconstruction: pycolmap.Reconstruction, folder: Path) -> None:
    lost = first_name_lost_in_text(image.name for image in reconstruction.images.values())
    if lost is None:
        reconstruction.write_text(folder)
    else:
        logger.warning("no model as text: COLMAP would cut the name %r at its white space", lost)


def _replace(folder: Path) -> None:
    fresh, old = _beside(folder)
    if folder.exists():
        shutil.rmtree(old, ignore_errors=True)
        folder.rename(old)
    fresh.rename(folder)
    sync(folder.parent)
    shutil.rmtree(old, ignore_errors=True)


def color_points(
    reconstruction: pycolmap.Reconstruction,
    colors: Mapping[int, Uint8Array],
    point_ids: Iterable[int],
) -> None:
    """Give points the mean colour of the keypoints in their tracks; ``colors`` as above."""
    for point_id in point_ids:
        point = reconstruction.point3D(point_id)
        seen = [colors[e.image_id][e.point2D_idx] for e in point.track.elements]
        point.color = np.mean(seen, axis=0).round().astype(np.uint8)

"""What is exported: one model, where its photos are, and where on Earth it is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import pycolmap

from sfm_front.errors import InputError
from sfm_front.exporters.options import ExportOptions
from sfm_front.geometry.enu import LocalFrame
from sfm_front.georeference.sidecar import FILE_NAME, read_sidecar
from sfm_front.photos.source import files_by_name
from sfm_front.storage.colmap_models import find_models, is_model, read_model
from sfm_front.storage.database import DATABASE
from sfm_front.storage.session_photos import read_photos
from sfm_front.storage.written_models import damaged_file, read_state
from sfm_front.types import GeoPosition

Progress = Callable[[int, int], None]
"""Told how many photos are done, of how many."""


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """``model`` is an exporter's own, to change as it needs.

    ``photos``: name → file, of those that are known; ``positions``: what EXIF says, by name;
    ``frame``: that of the model's coordinates if they are east, north and up in metres.
    """

    model: pycolmap.Reconstruction
    photos: Mapping[str, Path]
    positions: Mapping[str, GeoPosition]
    frame: LocalFrame | None


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """A scene to be written to ``folder``, which is there and empty."""

    scene: Scene
    folder: Path
    options: ExportOptions
    on_progress: Progress


def output_of(source: Path) -> Path:
    """The folder that ``source`` belongs to: itself, or the output that the model lies in."""
    place = source.absolute()
    if is_model(place) and place.parent.name == "sparse":
        return place.parent.parent
    return source


def read_scene(source: Path, *, number: int | None = None, images: Path | None = None) -> Scene:
    """The model at ``source``, or of an output: that of this ``number``, by default the largest.

    ``images``: the folder where the photos are, if they are no longer where the session found
    them, or if no session did. Raises InputError if there is no such model, or it is broken or
    empty, or there is no such folder.
    """
    folder, model = _read_model(source, number)
    if not model.num_reg_images():
        raise InputError(f"{folder}: the model has no photo in it: there is nothing to export")
    output = output_of(source)
    stored = read_photos(output / DATABASE) or []
    photos = {photo.name: photo.path for photo in stored}
    if images is not None:
        photos = files_by_name(images)
    positions = {photo.name: p for photo in stored if (p := photo.exif.position) is not None}
    return Scene(model, photos, positions, _frame(folder))


def _read_model(source: Path, number: int | None) -> tuple[Path, pycolmap.Reconstruction]:
    if is_model(source):
        if number is not None:
            raise InputError(f"{source}: is one model already; leave --model out")
        _check_whole(source.absolute().parent)
        return source, read_model(source)
    folders = find_models(source / "sparse") or find_models(source)
    if not folders:
        read_model(source)  # Says what is missing.
    _check_whole(folders[0].parent)
    if number is not None:
        named = [folder for folder in folders if folder.name == str(number)]
        if not named:
            there = ", ".join(folder.name for folder in folders)
            raise InputError(f"{source}: has no model {number}; there are: {there}")
        return named[0], read_model(named[0])
    models = [(folder, read_model(folder)) for folder in folders]
    return max(models, key=lambda model: model[1].num_reg_images())


def _check_whole(sparse: Path) -> None:
    """pycolmap may read for ever if a session's model was cut short."""
    try:
        damaged = damaged_file(sparse, read_state(sparse)["files"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return
    if damaged is not None:
        raise InputError(
            f"{sparse / damaged}: not whole. Give the reconstruct command again: it mends it."
        )


def _frame(folder: Path) -> LocalFrame | None:
    """The frame of the sidecar beside a model, if that is in it."""
    file = folder.absolute().parent / FILE_NAME
    if not file.is_file():
        return None
    sidecar = read_sidecar(file)
    return sidecar.origin if folder.name in map(str, sidecar.models_in_enu) else None

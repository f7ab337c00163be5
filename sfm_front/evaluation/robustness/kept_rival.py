"""COLMAP's models of some photos, built once and kept."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from sfm_front.errors import InputError
from sfm_front.evaluation.reconstruction.rivals import run_rival
from sfm_front.evaluation.reconstruction.types import BenchmarkSettings
from sfm_front.photos.source import list_photos
from sfm_front.storage.colmap_models import find_models
from sfm_front.types import PhotoPath

_DECISIVE = ("max_image_size_px", "max_features", "camera_mode")


def rival_models(
    photos: Sequence[PhotoPath], folder: Path, settings: BenchmarkSettings
) -> list[Path]:
    """The folders of the models that COLMAP's exhaustive pipeline builds of these photos alone.

    Builds them in ``folder`` unless it exists. Beside what ``run_rival`` leaves it has ``images``,
    links to the photos. Raises InputError if it was built of other photos or with other
    ``settings``, or if COLMAP fails.
    """
    if folder.is_dir():
        _check(photos, folder, settings)
    else:
        _build(photos, folder, settings)
    return find_models(folder / "sparse")


def _check(photos: Sequence[PhotoPath], folder: Path, settings: BenchmarkSettings) -> None:
    try:
        task = json.loads((folder / "task.json").read_text("utf-8"))
        with_settings = [task[name] for name in _DECISIVE]
        of_photos = {photo.name for photo in list_photos(folder / "images")}
    except (OSError, ValueError, KeyError, InputError) as error:
        raise InputError(f"{folder}: no results of COLMAP's in it; give another folder") from error
    if with_settings != [getattr(settings, name) for name in _DECISIVE]:
        raise InputError(f"{folder}: built with other settings; give another folder")
    if of_photos != {photo.name for photo in photos}:
        raise InputError(f"{folder}: built of other photos; give another folder")


def _build(photos: Sequence[PhotoPath], folder: Path, settings: BenchmarkSettings) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=folder.parent, prefix=".building_") as scratch:
        images, workspace = Path(scratch) / "images", Path(scratch) / "workspace"
        for photo in photos:
            link = images / photo.name
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(photo.path.resolve())
        run = run_rival("exhaustive", images, workspace, settings)
        if not run.seconds_by_stage:  # it did not come to its end
            raise InputError(f"{folder}: COLMAP failed ({run.failure})")
        images.rename(workspace / images.name)
        workspace.rename(folder)

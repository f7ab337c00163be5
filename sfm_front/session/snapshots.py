"""The models of a session that runs, in ``sparse/``: what any COLMAP tool reads, and resume."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pycolmap

from sfm_front.errors import InputError, StorageError
from sfm_front.exporters.colmap import (
    color_points,
    export_models,
    recover_models,
)
from sfm_front.georeference.sidecar import Sidecar
from sfm_front.mapping.model import Model
from sfm_front.mapping.model_state import ModelState
from sfm_front.storage.colmap_models import read_model
from sfm_front.storage.watched_mark import is_watched
from sfm_front.storage.written_models import STATE, damaged_file
from sfm_front.types import ModelSummary, Uint8Array

logger = logging.getLogger(__name__)

MakeSidecar = Callable[[], "Sidecar | None"]
"""Makes what stands in ``georeference.json``."""

_VERSION = 1
# A snapshot of a large model takes long: at most this share of the time goes into them.
_MAX_SHARE = 0.05
# But none waits longer for the one before: that may have taken so long because the machine slept.
_MAX_WAIT_S = 600.0
# The first one comes after so many seconds, the next ones after this share of the session's age: of
# what was mapped when a young session is killed, at most a quarter is mapped again.
_FIRST_S = 1.0
_SHARE_OF_AGE = 1 / 3
# Who looks at the models wants to see them grow, but not to wait for them.
_WATCHED_S = 1.0
_WATCHED_SHARE = 0.02


@dataclass(frozen=True)
class Snapshot:
    """Models as they were when ``num_photos`` photos had been added."""

    num_photos: int
    models: tuple[tuple[pycolmap.Reconstruction, ModelState], ...]
    # As ``Georeferencing.as_json`` gave it; None in those of earlier versions.
    georeferencing: dict[str, Any] | None


class Snapshots:
    """Writes the models every ``interval_s``, and more often while the session is young or somebody
    looks at them."""

    def __init__(self, folder: Path, interval_s: float) -> None:
        self._folder = folder
        self._interval_s = interval_s
        # Model id → point id; later points have higher ones.
        self._last_colored: dict[int, int] = {}
        self._began = self._last = time.monotonic()
        # How long the last one took.
        self._spent = 0.0

    @property
    def is_due(self) -> bool:
        """Whether the last one is old enough."""
        now = time.monotonic()
        wanted_s = max(_FIRST_S, (self._last - self._began) * _SHARE_OF_AGE)
        watched_s = max(_WATCHED_S, self._spent / _WATCHED_SHARE)
        if watched_s < wanted_s and is_watched(self._folder.parent):
            wanted_s = watched_s
        rest_s = min(self._spent / _MAX_SHARE, _MAX_WAIT_S)
        return now - self._last >= max(min(self._interval_s, wanted_s), rest_s)

    def write(
        self,
        models: Sequence[Model],
        num_photos: int,
        colors: Mapping[int, Uint8Array],
        georeferencing: Mapping[str, Any],
        sidecar: MakeSidecar,
        *,
        final: bool = False,
        text: bool = False,
    ) -> list[ModelSummary]:
        """Write all models, whole or not at all; ``final`` ones with their point clouds.

        ``georeferencing``: as ``Georeferencing.as_json`` gives it. ``sidecar`` makes what stands in
        ``georeference.json``: of many photos this takes its time, too.

        Raises StorageError if the disk is full, or the output was removed.
        """
        if not self._folder.parent.is_dir():
            # Else it would be made anew, with models but without what a session goes on from.
            raise StorageError(
                f"{self._folder.parent}: was removed while it was written to. Begin anew with the "
                "same command."
            )
        started = time.monotonic()
        if not final:
            for model in models:
                self._color_new(model, colors)
        summaries = export_models(
            [model.reconstruction for model in models],
            colors if final else None,
            self._folder,
            text=text,
            point_clouds=final,
            state={
                "version": _VERSION,
                "num_photos": num_photos,
                "models": [asdict(model.state) for model in models],
                "georeferencing": georeferencing,
            },
            sidecar=sidecar(),
        )
        self._last = time.monotonic()
        self._spent = self._last - started
        return summaries

    def _color_new(self, model: Model, colors: Mapping[int, Uint8Array]) -> None:
        """Colour points that have come since the last time; those read from disk have theirs."""
        reconstruction, since = model.reconstruction, self._last_colored.get(model.model_id, 0)
        point_ids = reconstruction.point3D_ids()
        new = [i for i in point_ids if i > since and not reconstruction.point3D(i).color.any()]
        color_points(reconstruction, colors, new)
        self._last_colored[model.model_id] = max(point_ids, default=0)


def read_snapshot(folder: Path) -> Snapshot | None:
    """The last one; None if there is none, or it is damaged: then its models are grown anew."""
    recover_models(folder)
    try:
        content: dict[str, Any] = json.loads((folder / STATE).read_text(encoding="utf-8"))
        if content["version"] != _VERSION:
            raise ValueError(f"version {content['version']}")
        states = [ModelState(**state) for state in content["models"]]
        num_photos = int(content["num_photos"])
        damaged = damaged_file(folder, content["files"])
        if damaged is not None:
            raise ValueError(f"{damaged} is not whole")
        models = tuple((read_model(folder / str(n)), state) for n, state in enumerate(states))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, InputError) as error:
        logger.warning("%s: models cannot be read (%s): growing them anew", folder, error)
        return None
    return Snapshot(num_photos, models, content.get("georeferencing"))

"""Read all that the page is made of, also while a session goes on writing it."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pycolmap

from sfm_front.errors import InputError
from sfm_front.georeference.sidecar import FILE_NAME, read_sidecar
from sfm_front.photos.source import files_by_name
from sfm_front.reports import event_log
from sfm_front.reports.html import SCENE_FILE
from sfm_front.reports.html.material import Material
from sfm_front.reports.html.observations import observations_of
from sfm_front.reports.report_json import read_report
from sfm_front.reports.run_summary import RunSummary
from sfm_front.reports.standing import Standing, read_story, standing
from sfm_front.reports.story import Story
from sfm_front.reports.unfinished import (
    Moment,
    sum_up_so_far,
    words_of_stopped,
    words_so_far,
)
from sfm_front.storage.colmap_models import read_model
from sfm_front.storage.database import DATABASE
from sfm_front.storage.stored_session import StoredSession, read_stored_session

# A session that runs replaces its models within some hundredths of a second.
_TRIES = 5
_PAUSE_S = 0.2


def read_material(output: Path, photos: Path | None = None) -> Material:
    """``photos``: the folder of the photos, if they are no longer where they were.

    Raises InputError if ``output`` is not that of a session, a file of it cannot be read, or there
    is no such folder.
    """
    story = read_story(output)
    if story.is_unfinished:
        return _material_so_far(output, story, photos)
    summary = read_report(output)
    models = [read_model(output / model.path) for model in summary.models]
    session = read_stored_session(output / DATABASE)
    material = _material(output, summary, models, session, photos)
    return replace(material, how_it_stands=words_of_stopped(story), command=story.command)


def _material_so_far(output: Path, story: Story, photos: Path | None) -> Material:
    """Of a session that may be writing meanwhile: all of its models as of one moment."""
    stands = standing(story, output)
    for _ in range(_TRIES):
        with suppress(OSError, ValueError, KeyError, TypeError, InputError):
            moment = Moment.of(output)
            folders = [output / path for path in moment.paths]
            models = [read_model(folder) for folder in folders]
            observed = [observations_of(*one) for one in zip(models, folders, strict=True)]
            session = read_stored_session(output / DATABASE)
            summary = sum_up_so_far(output, story, session, moment, models)
            material = _material(output, summary, models, session, photos)
            if Moment.of(output) == moment:
                return replace(
                    material,
                    how_it_stands=words_so_far(story, stands, moment),
                    command=story.command,
                    is_finished=False,
                    is_running=stands is Standing.RUNS,
                    observed=dict(enumerate(observed)),
                )
        time.sleep(_PAUSE_S)
    raise InputError(f"{output}: its models cannot be read now. Try again.")


def _material(
    output: Path,
    summary: RunSummary,
    models: Sequence[pycolmap.Reconstruction],
    session: StoredSession,
    photos: Path | None,
) -> Material:
    files = {**session.skipped, **{photo.name: photo.path for photo in session.photos}}
    sidecar = output / "sparse" / FILE_NAME
    began, version = _beginning(output)
    return Material(
        output=output,
        summary=summary,
        models=models,
        session=session,
        sidecar=read_sidecar(sidecar) if sidecar.is_file() else None,
        files=files if photos is None else files_by_name(photos),
        has_scene=(output / SCENE_FILE).is_file(),
        began=began,
        version=version,
    )


def _beginning(output: Path) -> tuple[str, str]:
    """When the session began, and the program's version, as its first event says."""
    try:
        with (output / event_log.FILE).open(encoding="utf-8") as lines:
            first = json.loads(lines.readline())
        return str(first["time"])[:16].replace("T", " "), str(first["version"])
    except (OSError, ValueError, KeyError, TypeError):
        return "", ""

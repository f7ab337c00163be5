"""What must hold of an output however its run ended: whole photos, nothing twice, whole models."""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from sfm_front.evaluation.crashes.colmap_view import ColmapView, colmap_view
from sfm_front.reports.event_log import FILE as EVENTS
from sfm_front.storage.database import DATABASE
from sfm_front.storage.written_models import STATE, damaged_file

_OURS = {"sfm_front_session", "sfm_front_photos", "sfm_front_skipped", "sfm_front_pairs"}
# COLMAP's id of a pair is id1 * _PAIR + id2, of the lower id and the higher one.
_PAIR = 2**31 - 1
_FRAMES = "(SELECT data_id image_id FROM frames JOIN frame_data USING (frame_id))"
_PARTS = {
    "frame": _FRAMES,
    "keypoints": "keypoints",
    "descriptors": "descriptors",
    "row in sfm_front_photos": "sfm_front_photos",
}
_PAIRS = (
    f"(SELECT min(later, earlier) * {_PAIR} + max(later, earlier) pair_id FROM sfm_front_pairs)"
)
# What each finds must not be there.
_CHECKS = {
    "photo without its camera or rig": "SELECT name FROM images WHERE camera_id NOT IN "
    "(SELECT camera_id FROM cameras) OR camera_id NOT IN (SELECT rig_id FROM rigs)",
    "keypoints and descriptors differ in number": "SELECT name FROM images "
    "JOIN keypoints k USING (image_id) JOIN descriptors d USING (image_id) WHERE k.rows != d.rows",
    "photo twice": "SELECT name FROM images GROUP BY name HAVING count(*) > 1",
    "content twice": "SELECT digest FROM sfm_front_photos GROUP BY digest HAVING count(*) > 1",
    "photo with two frames": f"SELECT image_id FROM {_FRAMES} "
    "GROUP BY image_id HAVING count(*) > 1",
    "photo both used and skipped": "SELECT name FROM images JOIN sfm_front_skipped USING (name)",
    "pair twice": f"SELECT pair_id FROM {_PAIRS} GROUP BY pair_id HAVING count(*) > 1",
    **{
        f"pair in {there} that is not in {missing}": f"SELECT pair_id FROM {there} "
        f"WHERE pair_id NOT IN (SELECT pair_id FROM {missing})"
        for there, missing in (
            ("matches", "two_view_geometries"),
            ("two_view_geometries", "matches"),
            ("matches", _PAIRS),
            (_PAIRS, "matches"),
        )
    },
    "pair whose photo is missing": f"SELECT pair_id FROM matches WHERE pair_id / {_PAIR} NOT IN "
    f"(SELECT image_id FROM images) OR pair_id % {_PAIR} NOT IN (SELECT image_id FROM images)",
    **{
        f"photo without {part}": "SELECT name FROM images "
        f"WHERE image_id NOT IN (SELECT image_id FROM {table})"
        for part, table in _PARTS.items()
    },
    **{
        f"{part} without a photo": f"SELECT image_id FROM {table} "
        "WHERE image_id NOT IN (SELECT image_id FROM images)"
        for part, table in _PARTS.items()
    },
}


@dataclass(frozen=True)
class Acknowledged:
    """A photo that ``events.jsonl`` says is stored, and with which photos it was verified."""

    name: str
    image_id: int
    verified: tuple[str, ...]


def events(output: Path) -> list[dict[str, Any]]:
    """Whole lines of ``events.jsonl``; the last one may be torn."""
    file = output / EVENTS
    if not file.exists():
        return []
    whole = file.read_bytes().split(b"\n")[:-1]
    return [json.loads(line) for line in whole]


def acknowledged(output: Path) -> list[Acknowledged]:
    """Photos that the session has said are stored, in order."""
    return [
        Acknowledged(event["name"], event["image_id"], tuple(event["verified"]))
        for event in events(output)
        if event["event"] == "photo_added"
    ]


def violations(output: Path, photos: Collection[Acknowledged] | None = None) -> list[str]:
    """What is wrong with an output whose process has ended; it is not touched.

    ``photos`` must be whole in the database, by default those that ``events.jsonl`` acknowledges.
    """
    expected = acknowledged(output) if photos is None else list(photos)
    twice = [name for name, count in Counter(p.name for p in expected).items() if count > 1]
    found = [f"acknowledged twice: {name}" for name in twice]
    with TemporaryDirectory(prefix="sfm_front_oracle_") as scratch:
        # Opening recovers it, which is the next run's to do.
        database = copy_database(output, Path(scratch))
        found += database_violations(database, expected)
        # Of a model cut short pycolmap may read for ever, and take all memory there is.
        half = _half_model(output / "sparse")
        view = colmap_view(database, output / "sparse" if half is None else Path(scratch) / "none")
    if half is not None:
        return [*found, *view.broken, f"half model: {half} is not as long as {STATE} says"]
    return [*found, *view.broken, *_model_violations(output / "sparse", view)]


def copy_database(output: Path, folder: Path) -> Path:
    """Copy the database with what is not yet moved into it; the copy's path."""
    for name in (DATABASE, f"{DATABASE}-wal"):
        if (output / name).exists():
            shutil.copyfile(output / name, folder / name)
    return folder / DATABASE


def stored_photos(database: Path) -> dict[int, str]:
    """Image id → name of all photos."""
    with closing(sqlite3.connect(database)) as opened:
        return dict(opened.execute("SELECT image_id, name FROM images ORDER BY image_id"))


def database_violations(database: Path, expected: Collection[Acknowledged]) -> list[str]:
    """What is wrong with a database; ``expected`` photos must be in it. Opening it recovers it."""
    if not database.exists():
        return [f"no database, but {len(expected)} photos acknowledged"] if expected else []
    try:
        with closing(sqlite3.connect(database)) as opened:
            return list(_examine(opened, expected))
    except sqlite3.Error as error:
        return [f"database cannot be read: {error}"]


def _examine(opened: sqlite3.Connection, expected: Collection[Acknowledged]) -> Iterator[str]:
    for (line,) in opened.execute("PRAGMA integrity_check"):
        if line != "ok":
            yield f"database damaged: {line}"
    tables = {name for (name,) in opened.execute("SELECT name FROM sqlite_master")}
    if not tables >= _OURS:
        # The session had not come to its first photo.
        images = opened.execute("SELECT count(*) FROM images").fetchone()[0]
        if images or expected:
            yield f"tables are missing: {', '.join(sorted(_OURS - tables))}"
        return
    for what, query in _CHECKS.items():
        for (which,) in opened.execute(query):
            yield f"{what}: {which}"
    ids = dict(opened.execute("SELECT name, image_id FROM images"))
    if sorted(ids.values()) != list(range(1, len(ids) + 1)):
        yield f"image ids with gaps: {sorted(ids.values())}"
    pairs = {pair_id for (pair_id,) in opened.execute("SELECT pair_id FROM matches")}
    for photo in expected:
        if ids.get(photo.name) != photo.image_id:
            yield f"acknowledged photo is missing: {photo.name}"
            continue
        for name in photo.verified:
            low, high = sorted((photo.image_id, ids.get(name, 0)))
            if low * _PAIR + high not in pairs:
                yield f"acknowledged pair is missing: {photo.name} with {name}"


def _half_model(sparse: Path) -> str | None:
    """The first file of a model that is there, and not whole."""
    try:
        sizes = json.loads((sparse / STATE).read_text(encoding="utf-8"))["files"]
    except (OSError, ValueError, KeyError):
        return None
    there = {name: size for name, size in sizes.items() if (sparse / name).parent.is_dir()}
    return damaged_file(sparse, there)


def _model_violations(sparse: Path, view: ColmapView) -> Iterator[str]:
    if not sparse.exists():
        return
    try:
        state = json.loads((sparse / STATE).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        yield f"{STATE} cannot be read: {error}"
        return
    if len(state["models"]) != len(view.models) and not view.broken:
        yield f"{len(view.models)} models where {STATE} has {len(state['models'])}"
    if state["num_photos"] > len(view.images):
        yield f"models of {state['num_photos']} photos, the database holds {len(view.images)}"
    for model, images in view.models.items():
        for image_id, image in images.items():
            if view.images.get(image_id) != image:
                yield f"model {model}: image {image_id} is {image}, not as in the database"

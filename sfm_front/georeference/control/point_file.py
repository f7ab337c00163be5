"""ODM's ``gcp_list.txt`` → control points, checkpoints and their marks in photos."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sfm_front.errors import InputError
from sfm_front.geometry.enu import LocalFrame, lat_lon_alt
from sfm_front.photos.crs import Crs
from sfm_front.types import GeoPosition

MIN_POINTS = 3
"""Control points that a model needs, beside checkpoints."""
MIN_SPREAD = 0.02
"""Width of the area of the control points over its length: on a line they leave a turn open."""

_NO_HEIGHT = ("nan", "-", "none")
_CHECK = ("check", "checkpoint")
# Heights of exactly 0 are heights if another point lies as near to 0, in metres.
_NEAR_SEA_LEVEL_M = 20.0
_COLUMNS = "x y z px py photo [name [h_acc v_acc]] [check]"


@dataclass(frozen=True, slots=True)
class Mark:
    """Where a point is seen: pixels as in the file, the top-left pixel centred at (0, 0)."""

    photo: str
    x: float
    y: float
    line: int


@dataclass(frozen=True, slots=True)
class ControlPoint:
    """A surveyed point; one without an altitude holds a model horizontally only.

    A checkpoint is measured in the model, but does not hold it.
    """

    name: str
    position: GeoPosition
    marks: tuple[Mark, ...]
    is_checkpoint: bool = False


@dataclass(frozen=True, slots=True)
class _Row:
    """A line: one mark of a point. ``name`` is empty if the file has none."""

    name: str
    xy: tuple[float, float]
    height: float | None
    mark: Mark
    sigmas: tuple[float, float] | None
    is_checkpoint: bool


def read_control_points(path: Path) -> list[ControlPoint]:
    """The points of the file in order.

    The first line names the reference system (``Crs``), each other line a mark:
    ``x y z px py photo [name [h_acc v_acc]] [check]``, split at tabs if there are any. Lines with
    the same name, or the same coordinates, are marks of one point. A height that is not known is
    ``nan``, ``-``, or 0 where no other point lies near 0. ``h_acc`` and ``v_acc`` are standard
    deviations in metres, as in ODM's ``geo.txt``. A point is a checkpoint if its name ends in
    ``_check`` or a column after the photo says ``check``.

    InputError, with the line, for what cannot be read, and if the control points are fewer than
    three or on a line; DependencyError as ``Crs.parse``.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    numbered = [
        (number, line.strip())
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not numbered:
        raise InputError(f"{path}: empty. A first line with the reference system is expected.")
    crs = _parse_crs(path, *numbered[0])
    rows = _without_sea_level([_parse_row(path, number, line) for number, line in numbered[1:]])
    points = [_point(path, crs, of_point) for of_point in _by_point(path, rows)]
    check_geometry(path, [point for point in points if not point.is_checkpoint])
    return points


def check_geometry(path: Path, control: list[ControlPoint]) -> None:
    """InputError unless at least three control points have two marks each and form a triangle."""
    usable = [point for point in control if len(point.marks) >= 2]
    if len(usable) < MIN_POINTS:
        raise InputError(
            f"{path}: {len(usable)} control points with marks in two photos or more; "
            f"at least {MIN_POINTS} are needed, beside checkpoints."
        )
    if spread(usable) < MIN_SPREAD:
        raise InputError(
            f"{path}: the {len(usable)} control points lie on a line, round which the model could "
            "turn. Mark one beside it."
        )


def spread(points: list[ControlPoint]) -> float:
    """Width over length of the area of these points, by standard deviations; 0 for one place."""
    places = lat_lon_alt(point.position for point in points)
    places[:, 2] = 0
    enu = LocalFrame(*places[0]).to_enu(places)[:, :2]
    length, width = np.linalg.svd(enu - enu.mean(axis=0), compute_uv=False)
    return float(width / length) if length > 0 else 0.0


def _parse_crs(path: Path, number: int, line: str) -> Crs:
    try:
        _parse_row(path, number, line)
    except InputError:
        pass
    else:
        raise InputError(
            f"{path}, line {number}: the first line must name the reference system of the points, "
            "as EPSG:32632 or WGS84 UTM 32N."
        )
    try:
        return Crs.parse(line)
    except InputError as error:
        raise InputError(f"{path}, line {number}: {error}") from error


def _parse_row(path: Path, number: int, line: str) -> _Row:
    fields = [field.strip() for field in line.split("\t")]
    if len(fields) < 6:
        fields = line.split()
    if len(fields) < 6:
        raise InputError(f"{path}, line {number}: {len(fields)} columns; expected {_COLUMNS}.")
    x, y, px, py = (
        _number(path, number, column, fields[place])
        for column, place in (("x", 0), ("y", 1), ("px", 3), ("py", 4))
    )
    height = None if fields[2].lower() in _NO_HEIGHT else _number(path, number, "z", fields[2])
    extra = fields[6:]
    checked = any(field.lower() in _CHECK for field in extra)
    named = [field for field in extra if field and field.lower() not in _CHECK]
    name = named[0] if named else ""
    return _Row(
        name=name,
        xy=(x, y),
        height=height,
        mark=Mark(fields[5], px, py, number),
        sigmas=_sigmas(named[1:]),
        is_checkpoint=checked or name.lower().endswith("_check"),
    )


def _number(path: Path, number: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"{path}, line {number}: {column} is {text!r}, not a number; expected {_COLUMNS}."
        )
    return value


def _sigmas(extra: list[str]) -> tuple[float, float] | None:
    """Two positive numbers right after the name; other columns may hold anything."""
    try:
        horizontal, vertical = (float(field) for field in extra[:2])
    except ValueError:
        return None
    plausible = 0 < horizontal < math.inf and 0 < vertical < math.inf
    return (horizontal, vertical) if plausible else None


def _without_sea_level(rows: list[_Row]) -> list[_Row]:
    """Zeros in place of heights that are not known → None."""
    heights = [row.height for row in rows if row.height]
    if any(abs(height) < _NEAR_SEA_LEVEL_M for height in heights):
        return rows
    return [replace(row, height=row.height or None) for row in rows]


def _by_point(path: Path, rows: list[_Row]) -> list[list[_Row]]:
    """The rows of each point, points in order of their first row."""
    names = {(row.xy, row.height): row.name for row in reversed(rows) if row.name}
    points: dict[object, list[_Row]] = {}
    for row in rows:
        place = (row.xy, row.height)
        points.setdefault(names.get(place, place), []).append(row)
    for of_point in points.values():
        first = of_point[0]
        for row in of_point:
            if (row.xy, row.height) != (first.xy, first.height):
                raise InputError(
                    f"{path}, line {row.mark.line}: {row.name} has other coordinates than in line "
                    f"{first.mark.line}. Give each point a name of its own."
                )
    return list(points.values())


def _point(path: Path, crs: Crs, rows: list[_Row]) -> ControlPoint:
    first = rows[0]
    marks: dict[str, Mark] = {}
    for row in rows:
        known = marks.setdefault(row.mark.photo, row.mark)
        if (known.x, known.y) != (row.mark.x, row.mark.y):
            raise InputError(
                f"{path}, line {row.mark.line}: this point has another mark in {known.photo}, in "
                f"line {known.line}. Keep one of them."
            )
    try:
        position = crs.to_wgs84(*first.xy, first.height)
    except InputError as error:
        raise InputError(f"{path}, line {first.mark.line}: {error}") from error
    horizontal, vertical = next((row.sigmas for row in rows if row.sigmas), (None, None))
    return ControlPoint(
        name=next((row.name for row in rows if row.name), f"line {first.mark.line}"),
        position=replace(position, horizontal_sigma_m=horizontal, vertical_sigma_m=vertical),
        marks=tuple(marks.values()),
        is_checkpoint=any(row.is_checkpoint for row in rows),
    )

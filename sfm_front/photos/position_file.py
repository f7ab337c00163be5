"""A file of positions, CSV or ODM's ``geo.txt`` → the position of each photo that it names."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.photos.crs import Crs, looks_like_crs
from sfm_front.types import GeoPosition

_DELIMITERS = "\t;,"
_ALIASES = {
    "name": ("name", "file", "filename", "file_name", "image", "imagename", "image_name", "photo"),
    "y": ("lat", "latitude"),
    "x": ("lon", "long", "lng", "longitude"),
    "z": ("alt", "altitude", "height", "elevation", "z"),
    "h_acc": ("h_acc", "hacc", "horizontal_accuracy", "accuracy_horizontal"),
    "v_acc": ("v_acc", "vacc", "vertical_accuracy", "accuracy_vertical"),
}
# These say nothing of what they are in: the file has to.
_GRID_ALIASES = {"x": ("x", "easting", "east"), "y": ("y", "northing", "north")}
# How many numbers follow a name in geo.txt → what they are; the angles are not used.
_GEO_COLUMNS = {
    2: ("x", "y"),
    3: ("x", "y", "z"),
    5: ("x", "y", "z", "h_acc", "v_acc"),
    6: ("x", "y", "z", "yaw", "pitch", "roll"),
    8: ("x", "y", "z", "yaw", "pitch", "roll", "h_acc", "v_acc"),
}
_WHAT = (
    "a header with name, lat, lon and alt, or the coordinates' system, such as EPSG:4326, before "
    "lines of image, x, y and z"
)


@dataclass(frozen=True, slots=True)
class _Row:
    """Numbers by column, in the file's own system; an empty one is not there."""

    line: int
    name: str
    numbers: dict[str, float]


def read_position_file(file: Path) -> dict[str, GeoPosition]:
    """Name of a photo as in the file, with forward slashes → its position.

    Either form may begin with a line that names the coordinates' system; without one they are
    WGS84's latitude and longitude. Empty lines and those that begin with # are passed over.

    - CSV, separated by commas, semicolons or tabs, with a header:
      ``name,lat,lon,alt[,h_acc,v_acc]`` in any order, under their usual names; with a system also
      ``x`` and ``y``. Further columns are not read. ``alt`` and the accuracies may be empty.
    - ODM's ``geo.txt``: ``image x y [z] [yaw pitch roll] [h_acc v_acc]``, separated by white space,
      after the system; x is the longitude, if it has one.

    ``h_acc`` and ``v_acc`` are standard deviations in metres. Raises InputError that names file,
    line and mistake; DependencyError if the system needs pyproj.
    """
    lines = _lines(file)
    if not lines:
        raise InputError(f"{file}: is empty: it should begin with {_WHAT}")
    crs = None
    if looks_like_crs(lines[0][1]):
        crs = lines.pop(0)[1]
    if lines and (delimiter := _delimiter_of_header(lines[0][1])):
        rows = _csv_rows(file, lines, delimiter, has_crs=crs is not None)
    elif crs is not None:
        rows = _geo_rows(file, lines)
    else:
        raise InputError(f"{file}:{lines[0][0]}: should be {_WHAT}")
    return _positions(file, list(rows), crs or "EPSG:4326")


def _lines(file: Path) -> list[tuple[int, str]]:
    """Number and text of each line that says something."""
    try:
        text = file.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{file}: no such file: give a file of positions, or off") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: not UTF-8 at byte {error.start}: save it as UTF-8") from None
    numbered = enumerate(text.splitlines(), start=1)
    # Not stripped: cells at the end may be empty.
    return [(number, line) for number, line in numbered if line.strip() and line[0] != "#"]


# --- the two forms -------------------------------------------------------------------------------


def _delimiter_of_header(line: str) -> str | None:
    for delimiter in _DELIMITERS:
        cells = [_plain(cell) for cell in line.split(delimiter)]
        if len(cells) > 2 and set(cells) & set(_ALIASES["name"]):
            return delimiter
    return None


def _plain(header: str) -> str:
    """``"Latitude (deg)"`` → ``latitude``."""
    bare = re.sub(r"[\[(].*?[\])]", "", header).strip(" \"'").casefold()
    return re.sub(r"[^a-z]+", "_", bare).strip("_")


def _csv_rows(
    file: Path, lines: Sequence[tuple[int, str]], delimiter: str, *, has_crs: bool
) -> Iterator[_Row]:
    columns = _columns(f"{file}:{lines[0][0]}", _cells(lines[0][1], delimiter), has_crs)
    for line, text in lines[1:]:
        where, cells = f"{file}:{line}", _cells(text, delimiter)
        if len(cells) <= max(columns.values()):
            raise InputError(f"{where}: has {len(cells)} columns, fewer than the header")
        numbers = {
            column: _number(where, column, cells[i])
            for column, i in columns.items()
            if column != "name" and (cells[i] or column in ("x", "y"))
        }
        yield _Row(line, _name(where, cells[columns["name"]]), numbers)


def _cells(line: str, delimiter: str) -> list[str]:
    (cells,) = csv.reader([line], delimiter=delimiter, skipinitialspace=True)
    return [cell.strip() for cell in cells]


def _columns(where: str, header: Sequence[str], has_crs: bool) -> dict[str, int]:
    """What a column holds → which it is."""
    aliases = dict(_ALIASES)
    if has_crs:
        aliases |= {column: aliases[column] + more for column, more in _GRID_ALIASES.items()}
    columns: dict[str, int] = {}
    for number, text in enumerate(header):
        for column in (column for column, known in aliases.items() if _plain(text) in known):
            if column in columns:
                raise InputError(f"{where}: {header[columns[column]]} and {text} are the same")
            columns[column] = number
    for column, known in (("name", "name"), ("y", "lat"), ("x", "lon")):
        if column not in columns:
            raise InputError(f"{where}: the header has no {known}: it should be {_WHAT}")
    return columns


def _geo_rows(file: Path, lines: Sequence[tuple[int, str]]) -> Iterator[_Row]:
    for line, text in lines:
        where = f"{file}:{line}"
        name, *parts = text.split()
        columns = _GEO_COLUMNS.get(min(len(parts), 8))  # What follows them is ODM's "extras".
        if columns is None:
            raise InputError(
                f"{where}: has {len(parts)} numbers: it should be image, x, y, z, or with yaw, "
                "pitch, roll, or h_acc, v_acc, or both behind"
            )
        numbers = {
            column: _number(where, column, part)
            for column, part in zip(columns, parts, strict=False)
        }
        yield _Row(line, _name(where, name), numbers)


def _name(where: str, text: str) -> str:
    name = text.replace("\\", "/").removeprefix("./")
    if not name:
        raise InputError(f"{where}: names no photo")
    return name


def _number(where: str, column: str, text: str) -> float:
    shown = {"x": "x (or lon)", "y": "y (or lat)", "z": "z (or alt)"}.get(column, column)
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{where}: {shown} is {text!r}, which is no number")
    if column in ("h_acc", "v_acc") and number <= 0:
        raise InputError(f"{where}: {column} must be above 0 m, got {text}")
    return number


# --- into WGS84 ----------------------------------------------------------------------------------


def _positions(file: Path, rows: Sequence[_Row], crs_line: str) -> dict[str, GeoPosition]:
    if not rows:
        raise InputError(f"{file}: holds no position below its header")
    crs = _parse_crs(file, crs_line)
    found: dict[str, GeoPosition] = {}
    lines: dict[str, int] = {}
    for row in rows:
        where, key = f"{file}:{row.line}", row.name.casefold()
        if key in lines:
            raise InputError(f"{where}: {row.name} stands in line {lines[key]} too: leave one")
        lines[key] = row.line
        found[row.name] = replace(
            _in_wgs84(where, row, crs),
            horizontal_sigma_m=row.numbers.get("h_acc"),
            vertical_sigma_m=row.numbers.get("v_acc"),
        )
    return found


def _parse_crs(file: Path, line: str) -> Crs:
    try:
        return Crs.parse(line)
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def _in_wgs84(where: str, row: _Row, crs: Crs) -> GeoPosition:
    try:
        return crs.to_wgs84(row.numbers["x"], row.numbers["y"], row.numbers.get("z"))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None

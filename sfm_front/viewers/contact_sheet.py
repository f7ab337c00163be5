"""Search answers as one picture: each query, then the best photos in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, ImageDraw

from sfm_front.viewers.pictures import (
    BACKGROUND,
    FAINT,
    INK,
    QUERY,
    RULE,
    WRONG,
    Color,
    load,
    write,
)

COLUMNS = 5
SHOWN = 2 * COLUMNS
"""Photos shown per answer."""

_CELL = (264, 198)
_QUERY = (396, 297)
_GAP = 16
_MARGIN = 28
_NAME_SIZE = 17
_DETAIL_SIZE = 15
_CAPTION = 50
_THIN, _THICK = 1, 5


@dataclass(frozen=True, slots=True)
class Tile:
    """A photo with its name and a line of detail; framed red if ``wrong``."""

    path: Path
    name: str
    detail: str
    wrong: bool = False


@dataclass(frozen=True, slots=True)
class SheetRow:
    """A query and the photos found for it, best first."""

    query: Tile
    found: Sequence[Tile]


def contact_sheet(rows: Sequence[SheetRow]) -> Image.Image:
    """Each query on the left, at 1.5 times the size, with its ten best beside it in two rows."""
    step_x, step_y = _CELL[0] + _GAP, _CELL[1] + _CAPTION
    first_x = _MARGIN + _QUERY[0] + 2 * _GAP
    row_height = 2 * step_y + _GAP
    width = first_x + COLUMNS * step_x - _GAP + _MARGIN
    sheet = Image.new("RGB", (width, _MARGIN + len(rows) * (row_height + _MARGIN)), BACKGROUND)
    for number, row in enumerate(rows):
        top = _MARGIN + number * (row_height + _MARGIN)
        if number:
            y = top - _MARGIN // 2 - 1
            ImageDraw.Draw(sheet).line((_MARGIN, y, width - _MARGIN, y), RULE)
        query_top = top + (row_height - _QUERY[1] - _CAPTION) // 2
        _draw_tile(sheet, row.query, (_MARGIN, query_top), _QUERY, (QUERY, _THICK))
        for place, tile in enumerate(row.found[:SHOWN]):
            line = place // COLUMNS
            corner = first_x + place % COLUMNS * step_x, top + line * (step_y + _GAP)
            frame = (WRONG, _THICK) if tile.wrong else (FAINT, _THIN)
            _draw_tile(sheet, tile, corner, _CELL, frame)
    return sheet


def _draw_tile(
    sheet: Image.Image,
    tile: Tile,
    corner: tuple[int, int],
    size: tuple[int, int],
    frame: tuple[Color, int],
) -> None:
    """Draw the whole photo at the bottom of its cell, as large as fits, with its caption below."""
    color, thickness = frame
    photo = load(tile.path, max(size))
    room = size[0] - 2 * thickness, size[1] - 2 * thickness
    scale = min(room[0] / photo.width, room[1] / photo.height)
    photo = photo.resize(
        (max(1, round(photo.width * scale)), max(1, round(photo.height * scale))),
        Image.Resampling.LANCZOS,
    )
    left = corner[0] + (size[0] - photo.width) // 2
    bottom = corner[1] + size[1]
    top = bottom - photo.height - thickness
    ImageDraw.Draw(sheet).rectangle(
        (left - thickness, top - thickness, left + photo.width + thickness - 1, bottom - 1), color
    )
    sheet.paste(photo, (left, top))
    center = corner[0] + size[0] // 2
    for text, text_size, ink, y in (
        (tile.name, _NAME_SIZE, INK, bottom + 5),
        (tile.detail, _DETAIL_SIZE, WRONG if tile.wrong else FAINT, bottom + 7 + _NAME_SIZE),
    ):
        write(sheet, text, (center, y), size=text_size, ink=ink, width=size[0], anchor="ma")

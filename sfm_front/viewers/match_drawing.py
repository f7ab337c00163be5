"""Two photos side by side, with a line for each match between them."""

from __future__ import annotations

import colorsys
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from sfm_front.types import Float64Array, Uint8Array
from sfm_front.viewers.pictures import BACKGROUND, INK, load, write

HEIGHT = 900
"""Height of both photos in pixels, less if one would become too wide."""

_LARGEST_WIDTH = 1400
_GAP = 12
_MARGIN = 20
_CAPTION = 52
_TEXT_SIZE = 24
_LINE_OPACITY = 0.7
MOST_LINES = 200
"""More lines than this would hide the photos."""

# OpenCV draws at sub-pixel positions given as fixed-point numbers.
_SHIFT_BITS = 4


def draw_matches(
    path1: Path,
    path2: Path,
    xy1: Float64Array,
    xy2: Float64Array,
    sizes: tuple[tuple[int, int], tuple[int, int]],
    caption: str,
) -> Image.Image:
    """Draw M matches, at ``xy1``, ``xy2`` (M, 2) in pixels of files of ``sizes`` (width, height).

    Every match has a circle in both photos, and a line if there are at most ``MOST_LINES``;
    otherwise as many, evenly spread from top to bottom, have lines, and the caption says so. Lines
    are coloured by the height of their left end, so that crossing ones stand out.
    """
    photos = [_fitted(path) for path in (path1, path2)]
    offsets = [(_MARGIN, _CAPTION), (_MARGIN + photos[0].width + _GAP, _CAPTION)]
    width = offsets[1][0] + photos[1].width + _MARGIN
    height = _CAPTION + max(photo.height for photo in photos) + _MARGIN
    canvas = Image.new("RGB", (width, height), BACKGROUND)
    for photo, offset in zip(photos, offsets, strict=True):
        canvas.paste(photo, offset)
    ends = [
        # (0, 0) is the corner of COLMAP's first pixel, but the centre of OpenCV's.
        xy * (photo.width / size[0], photo.height / size[1]) + offset - 0.5
        for xy, photo, size, offset in zip((xy1, xy2), photos, sizes, offsets, strict=True)
    ]
    drawn = Image.fromarray(_with_lines(np.array(canvas), ends[0], ends[1]))
    if len(xy1) > MOST_LINES:
        caption += f" ({MOST_LINES} drawn as lines)"
    write(
        drawn,
        caption,
        (width // 2, _CAPTION // 2),
        size=_TEXT_SIZE,
        ink=INK,
        width=width - 2 * _MARGIN,
        anchor="mm",
    )
    return drawn


def _fitted(path: Path) -> Image.Image:
    photo = load(path, max(HEIGHT, _LARGEST_WIDTH))
    scale = min(HEIGHT / photo.height, _LARGEST_WIDTH / photo.width)
    size = max(1, round(photo.width * scale)), max(1, round(photo.height * scale))
    return photo.resize(size, Image.Resampling.LANCZOS)


def _with_lines(pixels: Uint8Array, starts: Float64Array, ends: Float64Array) -> Uint8Array:
    lines = pixels.copy()
    top_down = np.argsort(starts[:, 1], kind="stable")
    starts, ends = starts[top_down], ends[top_down]
    fixed = [np.rint(xy * 2**_SHIFT_BITS).astype(int) for xy in (starts, ends)]
    colors = [_color(y / len(pixels)) for y in starts[:, 1]]
    count = min(MOST_LINES, len(starts))
    for i in np.linspace(0, len(starts) - 1, count).round().astype(int):
        start, end = (xy[i].tolist() for xy in fixed)
        cv2.line(lines, start, end, colors[i], 1, cv2.LINE_AA, _SHIFT_BITS)
    blended = cv2.addWeighted(lines, _LINE_OPACITY, pixels, 1 - _LINE_OPACITY, 0)
    for xy in fixed:
        for point, color in zip(xy, colors, strict=True):
            radius = 3 * 2**_SHIFT_BITS
            cv2.circle(blended, point.tolist(), radius, color, 1, cv2.LINE_AA, _SHIFT_BITS)
    return np.asarray(blended, np.uint8)


def _color(share: float) -> tuple[int, int, int]:
    """RGB, from red at the top to violet at the bottom."""
    red, green, blue = colorsys.hsv_to_rgb(0.8 * min(max(share, 0.0), 1.0), 0.9, 1.0)
    return round(255 * red), round(255 * green), round(255 * blue)

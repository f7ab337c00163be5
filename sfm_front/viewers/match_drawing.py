"""Two photos side by side, with a line for each match between them."""

from __future__ import annotations

import colorsys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
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
_OUTLIER = (150, 150, 150)


def draw_matches(
    path1: Path,
    path2: Path,
    xy1: Float64Array,
    xy2: Float64Array,
    sizes: tuple[tuple[int, int], tuple[int, int]],
    caption: str,
    is_inlier: NDArray[np.bool_] | None = None,
) -> Image.Image:
    """Draw M matches, at ``xy1``, ``xy2`` (M, 2) in pixels of files of ``sizes`` (width, height).

    Every match has a circle in both photos, and a line where there are ``MOST_LINES`` or fewer;
    else an even share of them, from top to bottom, has lines, and the caption says so. Lines are
    coloured by the height of their left end, so that neighbours can be told from those that cross
    them. With ``is_inlier`` (M,), the others are thin grey lines beneath, an even share of them.
    """
    if is_inlier is None:
        is_inlier = np.ones(len(xy1), np.bool_)
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
    pixels = _with_outliers(np.array(canvas), *(xy[~is_inlier] for xy in ends))
    drawn = Image.fromarray(_with_lines(pixels, *(xy[is_inlier] for xy in ends)))
    if np.count_nonzero(is_inlier) > MOST_LINES:
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
    starts, ends = _top_down(starts, ends)
    fixed = [_fixed_point(xy) for xy in (starts, ends)]
    colors = [_color(y / len(pixels)) for y in starts[:, 1]]
    for i in _even_share(len(starts)):
        start, end = (xy[i].tolist() for xy in fixed)
        cv2.line(lines, start, end, colors[i], 1, cv2.LINE_AA, _SHIFT_BITS)
    blended = cv2.addWeighted(lines, _LINE_OPACITY, pixels, 1 - _LINE_OPACITY, 0)
    for xy in fixed:
        for point, color in zip(xy, colors, strict=True):
            radius = 3 * 2**_SHIFT_BITS
            cv2.circle(blended, point.tolist(), radius, color, 1, cv2.LINE_AA, _SHIFT_BITS)
    return np.asarray(blended, np.uint8)


def _with_outliers(pixels: Uint8Array, starts: Float64Array, ends: Float64Array) -> Uint8Array:
    lines = pixels.copy()
    starts, ends = _top_down(starts, ends)
    for i in _even_share(len(starts)):
        start, end = (_fixed_point(xy[i]).tolist() for xy in (starts, ends))
        cv2.line(lines, start, end, _OUTLIER, 1, cv2.LINE_AA, _SHIFT_BITS)
    return np.asarray(cv2.addWeighted(lines, 0.5, pixels, 0.5, 0), np.uint8)


def _top_down(starts: Float64Array, ends: Float64Array) -> tuple[Float64Array, Float64Array]:
    order = np.argsort(starts[:, 1], kind="stable")
    return starts[order], ends[order]


def _fixed_point(xy: Float64Array) -> NDArray[np.int64]:
    return np.asarray(np.rint(xy * 2**_SHIFT_BITS), np.int64)


def _even_share(count: int) -> NDArray[np.int64]:
    """Indices of at most ``MOST_LINES``."""
    return np.asarray(np.linspace(0, count - 1, min(MOST_LINES, count)).round(), np.int64)


def _color(share: float) -> tuple[int, int, int]:
    """RGB, from red at the top to violet at the bottom."""
    red, green, blue = colorsys.hsv_to_rgb(0.8 * min(max(share, 0.0), 1.0), 0.9, 1.0)
    return round(255 * red), round(255 * green), round(255 * blue)

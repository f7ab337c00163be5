"""Marks of control points → pixels of the photos that are used."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from sfm_front.errors import InputError
from sfm_front.georeference.control.point_file import MIN_POINTS, ControlPoint, Mark

Size = tuple[int, int]
"""Width and height in pixels."""

# By which two photos of one shape may differ: a side is a whole number of pixels.
_SAME_SHAPE = 0.01


@dataclass(frozen=True, slots=True)
class PhotoMark:
    """A mark in a photo of the session: pixels, the top-left one centred at (0.5, 0.5)."""

    point: str
    photo: str
    x: float
    y: float


def marks_in_photos(
    points: Sequence[ControlPoint],
    sizes: Mapping[str, Size],
    marked_size: tuple[int, ...] | None = None,
) -> tuple[list[PhotoMark], list[str]]:
    """The marks in these photos (name → size of the file), and the names of other photos.

    A file's photo is the one of the same name or, if only one has it, of the same last part of the
    name. ``marked_size``: size of the photos in which the marks were made, where they have been
    reduced or enlarged since; turned, where it is a photo that is.

    InputError for a mark outside its photo, and for a name that fits several photos.
    """
    finder = _PhotoFinder(sizes)
    found, missing = [], dict[str, None]()
    for point in points:
        for mark in point.marks:
            photo = finder.find(mark)
            if photo is None:
                missing[mark.photo] = None
            else:
                x, y = _pixel(mark, photo, sizes[photo], marked_size)
                found.append(PhotoMark(point.name, photo, x, y))
    return found, list(missing)


def check_photos(file: Path, points: Sequence[ControlPoint], names: Iterable[str]) -> None:
    """InputError unless, in photos of these names, enough control points have two marks each."""
    finder = _PhotoFinder(names)
    control = [point for point in points if not point.is_checkpoint]
    usable = [p for p in control if sum(finder.find(m) is not None for m in p.marks) >= 2]
    if len(usable) < MIN_POINTS:
        absent = next(m.photo for p in control for m in p.marks if finder.find(m) is None)
        raise InputError(
            f"{file}: {len(usable)} control points have marks in two or more of the photos given; "
            f"at least {MIN_POINTS} are needed. {absent}, for one, is not among the photos: names "
            "are as below their folder."
        )


class _PhotoFinder:
    def __init__(self, names: Iterable[str]) -> None:
        self._names = dict.fromkeys(names)
        self._by_last_part: dict[str, list[str]] = {}
        for name in self._names:
            self._by_last_part.setdefault(last_part(name), []).append(name)

    def find(self, mark: Mark) -> str | None:
        if mark.photo in self._names:
            return mark.photo
        alike = self._by_last_part.get(last_part(mark.photo), [])
        if len(alike) > 1:
            raise InputError(
                f"line {mark.line} of the control points: {mark.photo} may be {alike[0]} or "
                f"{alike[1]}. Write its path below the photo folder."
            )
        return alike[0] if alike else None


def last_part(name: str) -> str:
    """``flight/A.JPG`` → ``a.jpg``"""
    return PurePosixPath(name.replace("\\", "/")).name.casefold()


def _pixel(
    mark: Mark, photo: str, size: Size, marked_size: tuple[int, ...] | None
) -> tuple[float, float]:
    width, height = size
    scale = 1.0
    if marked_size is not None:
        marked = sorted(marked_size)
        scale = max(size) / marked[1]
        if abs(scale * marked[0] - min(size)) > max(_SAME_SHAPE * min(size), 1):
            raise InputError(
                f"{photo} has {width} x {height} pixels, which is another shape than the "
                f"{marked_size[0]} x {marked_size[1]} of the photos with marks. Correct --gcp-size."
            )
    # ODM counts from the centre of the first pixel.
    x, y = scale * (mark.x + 0.5), scale * (mark.y + 0.5)
    if not (0 <= x <= width and 0 <= y <= height):
        raise InputError(
            f"line {mark.line} of the control points: ({mark.x:g}, {mark.y:g}) is outside {photo}, "
            f"which has {width} x {height} pixels. If the marks were made in larger photos, say "
            "how large: --gcp-size W,H."
        )
    return x, y

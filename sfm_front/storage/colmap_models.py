"""Find COLMAP models on disk and read them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from sfm_front.errors import InputError

if TYPE_CHECKING:
    import pycolmap

_PARTS = ("cameras", "images", "points3D")
_SUFFIXES = (".bin", ".txt")


def is_model(folder: Path) -> bool:
    """Whether ``folder`` itself holds a COLMAP model, binary or text."""
    return any(
        all((folder / f"{part}{suffix}").is_file() for part in _PARTS) for suffix in _SUFFIXES
    )


def find_models(folder: Path) -> list[Path]:
    """All folders at or below ``folder`` that hold a model; ``sparse/2`` before ``sparse/10``."""
    if not folder.is_dir():
        return []
    parents = {file.parent for file in folder.rglob("cameras.*")}
    return sorted(filter(is_model, parents), key=_by_number)


def read_model(folder: Path) -> pycolmap.Reconstruction:
    """Read the model in ``folder``; the binary one if it is there as text too.

    Raises ``InputError`` if the folder is missing, or its model is missing or broken.
    """
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; give the output of a reconstruction, or a COLMAP model"
        )
    if not is_model(folder):
        raise InputError(f"{folder}: no COLMAP model in it; {_hint(folder)}")
    import pycolmap

    try:
        return pycolmap.Reconstruction(folder)
    except (ValueError, RuntimeError, IndexError, MemoryError) as error:
        first_line = (str(error).splitlines() or ["unreadable"])[0]
        raise InputError(f"{folder}: broken COLMAP model ({first_line}); rebuild it") from error


def _by_number(folder: Path) -> list[tuple[int, str]]:
    return [(int(part) if part.isdigit() else -1, part) for part in folder.parts]


def _hint(folder: Path) -> str:
    below = find_models(folder)
    if (folder / "database.db").is_file() and not below:
        return "its session has built none so far; the same reconstruct command goes on"
    if not below:
        return "expected cameras, images and points3D, all .bin or all .txt"
    shown = ", ".join(str(path) for path in below[:5])
    return f"try {shown}" + (f" or {len(below) - 5} more below it" if len(below) > 5 else "")

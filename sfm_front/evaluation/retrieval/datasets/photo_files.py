"""Find a published dataset's photos on disk and report missing ones."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.photos.source import list_photos

_NAMED = 3


def photos_by_stem(folder: Path) -> dict[str, Path]:
    """Every photo at or below ``folder``, by its file name without extension.

    Archives unpack flat or into one sub-folder per place, and annotations name no folders.
    """
    return {photo.path.stem: photo.path for photo in list_photos(folder)}


def require(
    found: Collection[str], needed: Iterable[str], folder: Path, dataset: str, source: str
) -> None:
    """Raise ``InputError`` unless every photo ``needed`` is among those ``found``."""
    wanted = sorted(set(needed))
    missing = [name for name in wanted if name not in found]
    if missing:
        named = ", ".join(missing[:_NAMED]) + (", ..." if len(missing) > _NAMED else "")
        raise InputError(
            f"{folder}: {len(wanted) - len(missing)} of {len(wanted)} photos of {dataset} are "
            f"there ({named} missing); get them from {source}"
        )


def require_count(found: int, needed: int, folder: Path, dataset: str, source: str) -> None:
    """Raise ``InputError`` if fewer photos were found than the dataset has."""
    if found < needed:
        raise InputError(
            f"{folder}: {found} of {needed} photos of {dataset} are there; get them from {source}"
        )

"""Pictures of a session's photos, small, and of the matches between two of them."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from sfm_front.geometry.exif_orientation import QUARTER_TURNS
from sfm_front.photos.exif import read_exif
from sfm_front.reports.story import Story
from sfm_front.storage.database import DATABASE
from sfm_front.storage.photo_pairs import num_inliers, photo_file, verified_matches
from sfm_front.types import Uint8Array
from sfm_front.viewers.match_drawing import draw_matches
from sfm_front.viewers.pictures import load

_MOST_KEPT = 64
_MATCHES_WIDTH = 1100


class PhotoPictures:
    """Finds photos by the database of an output."""

    def __init__(self, output: Path) -> None:
        self._database = output / DATABASE
        self._load = lru_cache(maxsize=_MOST_KEPT)(_load)

    def stored(self, name: str, size: int) -> Uint8Array | None:
        """(h, w, 3) uint8, its long side at most ``size``, as its camera has it; a grey square
        with the reason if the file cannot be read; None if nobody knows where it is."""
        path = photo_file(self._database, name)
        return None if path is None else self._load(path, size)

    def upright(self, name: str, size: int) -> Uint8Array | None:
        """The same, turned as it was held."""
        path = photo_file(self._database, name)
        if path is None:
            return None
        turns = QUARTER_TURNS.get(read_exif(path).orientation, 0)
        return np.ascontiguousarray(np.rot90(self._load(path, size), -turns))

    def pairs(self, story: Story, name: str) -> list[tuple[str, int]]:
        """The photos with which one has verified pairs, and their inliers, the most first."""
        photo = story.photos.get(name)
        if photo is None or photo.image_id is None:
            return []
        names = {
            image_id: other
            for other in photo.links
            if (image_id := story.photos[other].image_id) is not None
        }
        found = num_inliers(self._database, photo.image_id, names)
        return sorted(((names[i], count) for i, count in found.items()), key=lambda pair: -pair[1])

    def matches(self, one: tuple[str, int], two: tuple[str, int]) -> Uint8Array | None:
        """Both photos, each by its name and image id, side by side with the matches of their
        verified pair; None if they have none."""
        found = verified_matches(self._database, one[1], two[1])
        paths = [photo_file(self._database, name) for name, _ in (one, two)]
        if found is None or paths[0] is None or paths[1] is None:
            return None
        caption = f"{len(found.xy1)} verified matches"
        drawn = draw_matches(paths[0], paths[1], found.xy1, found.xy2, found.sizes, caption)
        drawn.thumbnail((_MATCHES_WIDTH, _MATCHES_WIDTH))
        return np.asarray(drawn.convert("RGB"), np.uint8)


def _load(path: Path, size: int) -> Uint8Array:
    return np.asarray(load(path, size).convert("RGB"), np.uint8)

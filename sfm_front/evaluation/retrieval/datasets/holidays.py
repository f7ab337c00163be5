"""INRIA Holidays: 500 queries among 1491 photos, answers by file number.

Source: Jegou, Douze and Schmid, "Hamming embedding and weak geometric consistency for large scale
image search", ECCV 2008.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.evaluation.retrieval.datasets.photo_files import (
    photos_by_stem,
    require,
    require_count,
)
from sfm_front.evaluation.retrieval.types import Dataset, Query

SOURCE = "https://lear.inrialpes.fr/~jegou/data.php (jpg1.tar.gz and jpg2.tar.gz)"
NUM_PHOTOS = 1491
LIST_FILE = "holidays_images.dat"


def load(folder: Path) -> tuple[Dataset, ...]:
    """The dataset unpacked in ``folder``: ``jpg/100000.jpg`` and so on.

    If the evaluation package's ``holidays_images.dat`` lies beside the photos, it lists those
    required. Raises ``InputError`` if photos are missing.
    """
    photos = photos_by_stem(folder)
    listed = next(iter(sorted(folder.rglob(LIST_FILE))), None)
    if listed is None:
        stems = {stem for stem in photos if stem.isdecimal()}
        require_count(len(stems), NUM_PHOTOS, folder, "Holidays", SOURCE)
    else:
        stems = {Path(line).stem for line in listed.read_text("utf-8").split()}
        require(photos, stems, folder, "Holidays", SOURCE)
    names = {f"{stem}.jpg": photos[stem] for stem in sorted(stems)}
    return (Dataset("holidays", names, queries_of(names)),)


def queries_of(names: Iterable[str]) -> tuple[Query, ...]:
    """Photos are queries if their number is divisible by 100, and ignored in their own ranking.

    The query ``100000.jpg`` should find the other photos whose number, integer divided by 100, is
    1000.
    """
    groups: dict[int, list[str]] = defaultdict(list)
    for name in names:
        stem = Path(name).stem
        if not stem.isdecimal():
            raise InputError(f"{name}: photos of Holidays are named by number, such as 100000.jpg")
        groups[int(stem) // 100].append(name)
    queries = []
    for group in groups.values():
        first, *others = sorted(group)
        if int(Path(first).stem) % 100 == 0:
            queries.append(Query(first, first, frozenset(others), frozenset([first])))
    return tuple(queries)

"""Oxford5k and Paris6k: 55 queries each, a box in a photo, with lists of good, ok and junk photos.

Sources: Philbin et al., "Object retrieval with large vocabularies and fast spatial matching", CVPR
2007; the same, "Lost in quantization", CVPR 2008.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from sfm_front.errors import InputError
from sfm_front.evaluation.retrieval.datasets.photo_files import (
    photos_by_stem,
    require,
    require_count,
)
from sfm_front.evaluation.retrieval.types import Dataset, Query

OXFORD_SOURCE = "https://www.robots.ox.ac.uk/~vgg/data/oxbuildings/ (oxbuild_images.tgz)"
PARIS_SOURCE = "https://www.robots.ox.ac.uk/~vgg/data/parisbuildings/ (paris_1 and paris_2)"

#: Photos of Paris6k that were published broken (its corrupt.txt); all evaluations omit them.
CORRUPT_PARIS = frozenset(
    f"paris_{place}_{number:06d}"
    for place, numbers in {
        "louvre": (136, 146),
        "moulinrouge": (422,),
        "museedorsay": (1059,),
        "notredame": (188,),
        "pantheon": (284, 960, 974),
        "pompidou": (195, 196, 201, 467, 640),
        "sacrecoeur": (299, 330, 353),
        "triomphe": (662, 833, 863, 867),
    }.items()
    for number in numbers
)

# Query files of Oxford5k put this before the photo's name; it is not part of it.
_QUERY_PREFIX = "oxc1_"
_QUERY_FILE = "_query.txt"


def load(folder: Path, name: str, num_photos: int, source: str) -> tuple[Dataset, ...]:
    """The dataset in ``folder``: photos at any depth, and the text files of the ground truth.

    ``num_photos``: the number required, without broken ones. Raises ``InputError`` if photos or
    ground truth are missing.
    """
    photos = {
        stem: path
        for stem, path in sorted(photos_by_stem(folder).items())
        if stem not in CORRUPT_PARIS
    }
    lists = next(iter(sorted(folder.rglob(f"*{_QUERY_FILE}"))), None)
    if lists is None:
        raise InputError(
            f"{folder}: the ground truth of {name} is missing (all_*{_QUERY_FILE} and so on); "
            f"unpack it into this folder, from {source.split(' ')[0]}"
        )
    queries = read_queries(lists.parent)
    require_count(len(photos), num_photos, folder, name, source)
    needed = {query.photo for query in queries}.union(
        *(query.relevant | query.ignored for query in queries)
    )
    require(photos, needed, folder, name, source)
    return (Dataset(name, photos, queries),)


load_oxford5k = partial(load, name="oxford5k", num_photos=5063, source=OXFORD_SOURCE)
load_paris6k = partial(load, name="paris6k", num_photos=6392, source=PARIS_SOURCE)


def read_queries(folder: Path) -> tuple[Query, ...]:
    """Queries from the files ``NAME_query.txt`` and ``NAME_good.txt``, ``_ok``, ``_junk``.

    Photos are named without extension. As in the official ``compute_ap``, good and ok are
    relevant, and the query's own photo is not ignored.
    """
    return tuple(_query(file) for file in sorted(folder.glob(f"*{_QUERY_FILE}")))


def _query(file: Path) -> Query:
    name = file.name.removesuffix(_QUERY_FILE)
    photo, *corners = file.read_text("utf-8").split()
    try:
        left, top, right, bottom = map(float, corners)
    except ValueError as error:
        raise InputError(f"{file}: expected a photo's name and the four sides of a box") from error
    return Query(
        name=name,
        photo=photo.removeprefix(_QUERY_PREFIX),
        relevant=_listed(file, "good") | _listed(file, "ok"),
        ignored=_listed(file, "junk"),
        box=(left, top, right, bottom),
    )


def _listed(query_file: Path, kind: str) -> frozenset[str]:
    file = query_file.with_name(query_file.name.replace(_QUERY_FILE, f"_{kind}.txt"))
    if not file.is_file():
        raise InputError(f"{file}: missing; unpack the ground truth again")
    return frozenset(file.read_text("utf-8").split()) - CORRUPT_PARIS

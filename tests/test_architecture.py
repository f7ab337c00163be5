"""Which room of the package may import which, read from the source without running it."""

from __future__ import annotations

import pytest
from helpers.import_rules import (
    Import,
    between_rooms,
    find_circle,
    forbidden,
    listing,
    misplaced,
    not_pointing_down,
    read_imports,
    room_of,
    rooms_without_floor,
)
from helpers.locations import ROOT

PACKAGE = ROOT / "sfm_front"

# Rooms from the roof down to the ground. A room imports only rooms on lower floors, never one
# beside it. "sfm_front" is the public face, sfm_front/__init__.py. A room may be listed before it
# is built.
FLOORS = (
    ("cli", "evaluation"),
    ("cluster",),
    ("sfm_front",),
    ("session", "search", "live_page"),
    ("reports", "exporters"),
    ("features", "retrieval", "viewers", "georeference"),
    ("matching", "mapping", "storage"),
    ("runtime", "photos", "geometry"),
    ("events",),
    ("types", "errors", "version"),
)

# Most follow from the floors; they are spelled out so that a new floor plan cannot lose them.
NEVER = {
    "mapping": ("retrieval", "features"),
    "retrieval": ("mapping",),
    "matching": ("features", "mapping"),
    "photos": ("features", "mapping"),
    "storage": ("features", "mapping"),
    "session": ("cli", "evaluation"),
    "search": ("evaluation",),
    "cli": ("evaluation",),
}

# Heavy or optional libraries → the modules, or whole rooms, that may import them.
LIBRARIES = {
    "torch": (
        "sfm_front.features.global_descriptors.cnn",
        "sfm_front.features.global_descriptors.networks",
        "sfm_front.features.global_descriptors.weights",
        "sfm_front.matching.torch_matcher",
        "sfm_front.runtime.devices",
        "sfm_front.evaluation.retrieval.figures.first_layer",
    ),
    "torchvision": (),
    "open3d": ("sfm_front.viewers.open3d_loader",),
    "viser": ("sfm_front.live_page",),
    "matplotlib": ("sfm_front.evaluation",),
    "watchfiles": ("sfm_front.photos.folder_changes",),
    "pyproj": ("sfm_front.photos.crs",),
    "dask": ("sfm_front.cluster",),
    "distributed": ("sfm_front.cluster",),
    "pymetis": ("sfm_front.cluster.groups",),
}

MAX_FILES_AT_ROOT = 12


@pytest.fixture(scope="module")
def imports() -> list[Import]:
    return read_imports(PACKAGE)


@pytest.fixture(scope="module")
def arrows(imports: list[Import]) -> list[Import]:
    """Imports between rooms."""
    return between_rooms(imports, PACKAGE.name)


def test_every_room_has_a_floor() -> None:
    folders = [child.name for child in PACKAGE.iterdir() if any(child.glob("*.py"))]
    files = [file.stem for file in PACKAGE.glob("*.py") if file.name != "__init__.py"]
    assert rooms_without_floor(folders + files, FLOORS) == []


def test_arrows_between_rooms_point_down(arrows: list[Import]) -> None:
    wrong = not_pointing_down(arrows, FLOORS)
    assert not wrong, listing(wrong)


def test_rooms_that_must_not_know_each_other_do_not(arrows: list[Import]) -> None:
    wrong = forbidden(arrows, NEVER)
    assert not wrong, listing(wrong)


def test_nothing_outside_the_evaluation_imports_it(arrows: list[Import]) -> None:
    wrong = [arrow for arrow in arrows if room_of(arrow.imported) == "evaluation"]
    assert not wrong, listing(wrong)


def test_no_modules_import_each_other_in_a_circle(imports: list[Import]) -> None:
    assert find_circle(imports) == []


def test_heavy_libraries_stay_in_their_modules(imports: list[Import]) -> None:
    wrong = misplaced(imports, LIBRARIES)
    assert not wrong, listing(wrong)


def test_few_files_lie_at_the_root_of_the_package() -> None:
    assert len(list(PACKAGE.glob("*.py"))) <= MAX_FILES_AT_ROOT

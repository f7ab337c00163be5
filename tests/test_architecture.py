"""Which room of the package may import which, read from the source without running it."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from pathlib import Path
from typing import TypeAlias

import pytest
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

Floors: TypeAlias = Sequence[Sequence[str]]


@dataclass(frozen=True)
class Import:
    """One module importing another; both by dotted name."""

    importer: str
    imported: str
    line: int

    def __str__(self) -> str:
        return f"{self.importer}:{self.line} imports {self.imported}"


# --- reading -------------------------------------------------------------------------------------


def read_imports(package: Path) -> list[Import]:
    """All imports below ``package``, also in functions, for types only or by ``import_module``.

    ``from package import name`` imports ``package.name`` if that is a module, else ``package``.
    """
    files = {_module_name(package, file): file for file in sorted(package.rglob("*.py"))}
    imports = []
    for module, file in files.items():
        reader = _ImportReader(module, is_package=file.name == "__init__.py", modules=files)
        reader.visit(ast.parse(file.read_text(encoding="utf-8")))
        imports += reader.imports
    return imports


def _module_name(package: Path, file: Path) -> str:
    parts = file.relative_to(package.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


class _ImportReader(ast.NodeVisitor):
    def __init__(self, module: str, *, is_package: bool, modules: Collection[str]) -> None:
        self.imports: list[Import] = []
        self._module = module
        self._is_package = is_package
        self._modules = modules

    def visit_Import(self, node: ast.Import) -> None:
        for alias in node.names:
            self._add(alias.name, node.lineno)

    def visit_ImportFrom(self, node: ast.ImportFrom) -> None:
        source = node.module or ""
        if node.level:
            up = node.level - 1 if self._is_package else node.level
            parents = self._module.split(".")
            source = ".".join([*parents[: len(parents) - up], *filter(None, [source])])
        for alias in node.names:
            name = f"{source}.{alias.name}"
            self._add(name if name in self._modules else source, node.lineno)

    def visit_Call(self, node: ast.Call) -> None:
        called = node.func
        name = called.attr if isinstance(called, ast.Attribute) else getattr(called, "id", "")
        if name in ("import_module", "__import__") and node.args:
            target = node.args[0]
            if isinstance(target, ast.Constant) and isinstance(target.value, str):
                self._add(target.value, node.lineno)
        self.generic_visit(node)

    def _add(self, imported: str, line: int) -> None:
        self.imports.append(Import(self._module, imported, line))


# --- rules: each returns what breaks it ----------------------------------------------------------


def room_of(module: str) -> str:
    """``sfm_front.photos.exif`` → ``photos``; the package itself is the room of its face."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else parts[0]


def between_rooms(imports: Iterable[Import], package: str) -> list[Import]:
    """The imports of ``package`` that lead from one room into another."""
    return [
        found
        for found in imports
        if found.imported.split(".")[0] == package
        and room_of(found.importer) != room_of(found.imported)
    ]


def rooms_without_floor(rooms: Iterable[str], floors: Floors) -> list[str]:
    known = {room for floor in floors for room in floor}
    return sorted(set(rooms) - known)


def not_pointing_down(imports: Iterable[Import], floors: Floors) -> list[Import]:
    """Imports between rooms of one floor, or of a room above. All rooms need a floor."""
    depth = {room: number for number, floor in enumerate(floors) for room in floor}
    return [
        found
        for found in imports
        if depth[room_of(found.imported)] <= depth[room_of(found.importer)]
    ]


def forbidden(imports: Iterable[Import], never: Mapping[str, Sequence[str]]) -> list[Import]:
    """``never``: room → the rooms that it must not import."""
    return [
        found
        for found in imports
        if room_of(found.imported) in never.get(room_of(found.importer), ())
    ]


def misplaced(imports: Iterable[Import], libraries: Mapping[str, Sequence[str]]) -> list[Import]:
    """``libraries``: name → the modules or packages that may import it."""
    return [
        found
        for found in imports
        if (library := found.imported.split(".")[0]) in libraries
        and not any(f"{found.importer}.".startswith(f"{place}.") for place in libraries[library])
    ]


def find_circle(imports: Iterable[Import]) -> list[str]:
    """A circle of modules that import each other, the first one again at the end; else empty."""
    graph: dict[str, set[str]] = defaultdict(set)
    for found in imports:
        graph[found.importer].add(found.imported)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        # From the imported module to the one that imports it: turned round to read as imports.
        return list(reversed(error.args[1]))
    return []


def listing(imports: Iterable[Import]) -> str:
    return "\n".join(str(found) for found in imports)


# --- the package ---------------------------------------------------------------------------------


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


# --- the rules themselves, on a made-up package --------------------------------------------------

HOUSE = (("attic",), ("left", "right"), ("ground",))


def build(tmp_path: Path, **modules: str) -> list[Import]:
    """The imports of a package ``house``; ``left__a="..."`` is the text of ``left/a.py``."""
    package = tmp_path / "house"
    for name in ("ground", "left", "right", "attic"):
        (package / name).mkdir(parents=True)
        (package / name / "__init__.py").touch()
    (package / "__init__.py").touch()
    for name, text in modules.items():
        (package / f"{name.replace('__', '/')}.py").write_text(text, encoding="utf-8")
    return read_imports(package)


def pairs(imports: Iterable[Import]) -> list[tuple[str, str]]:
    return [(found.importer, found.imported) for found in imports]


def test_all_ways_to_import_are_read(tmp_path: Path) -> None:
    found = build(
        tmp_path,
        ground__a="",
        left__a=(
            "import house.ground.a as a, torch.nn\n"
            "from house.ground import a, name\n"
            "from . import b\n"
            "from ..ground.a import name\n"
            "def late():\n    from house.right import b\n"
            "import_module('open3d.visualization')\n"
            "if TYPE_CHECKING:\n    import house.right.b\n"
        ),
        left__b="",
        right__b="",
    )
    assert pairs(found) == [
        ("house.left.a", "house.ground.a"),
        ("house.left.a", "torch.nn"),
        ("house.left.a", "house.ground.a"),
        ("house.left.a", "house.ground"),
        ("house.left.a", "house.left.b"),
        ("house.left.a", "house.ground.a"),
        ("house.left.a", "house.right.b"),
        ("house.left.a", "open3d.visualization"),
        ("house.left.a", "house.right.b"),
    ]
    assert str(found[-2]) == "house.left.a:7 imports open3d.visualization"


def test_an_arrow_up_or_sideways_is_found(tmp_path: Path) -> None:
    found = build(
        tmp_path,
        ground__a="import house.left.a\n",
        left__a="import house.right\nimport house.ground\nimport house.left\n",
        attic__a="import house.left.a\n",
    )
    arrows = between_rooms(found, "house")
    assert len(arrows) == 4
    assert pairs(not_pointing_down(arrows, HOUSE)) == [
        ("house.ground.a", "house.left.a"),
        ("house.left.a", "house.right"),
    ]


def test_a_room_without_floor_is_found() -> None:
    assert rooms_without_floor(["left", "shed"], HOUSE) == ["shed"]


def test_a_forbidden_room_is_found(tmp_path: Path) -> None:
    found = build(tmp_path, attic__a="import house.left\nimport house.right\n")
    assert pairs(forbidden(found, {"attic": ("right",)})) == [("house.attic.a", "house.right")]


def test_a_circle_is_found_in_the_order_of_its_imports(tmp_path: Path) -> None:
    found = build(
        tmp_path,
        ground__a="def late():\n    import house.attic.a\n",
        left__a="import house.ground.a\n",
        attic__a="import house.left.a\nimport house.right\n",
    )
    circle = find_circle(found)
    assert circle[0] == circle[-1]
    assert set(pairwise(circle)) == {
        ("house.ground.a", "house.attic.a"),
        ("house.left.a", "house.ground.a"),
        ("house.attic.a", "house.left.a"),
    }
    assert find_circle(found[1:]) == []


def test_a_library_out_of_place_is_found(tmp_path: Path) -> None:
    found = build(
        tmp_path,
        left__net="import torch.nn\n",
        left__network="from torch import nn\n",
        right__a="def late():\n    import_module('torch')\n",
    )
    assert pairs(misplaced(found, {"torch": ("house.left.net",)})) == [
        ("house.left.network", "torch"),
        ("house.right.a", "torch"),
    ]
    assert pairs(misplaced(found, {"torch": ("house.left",)})) == [("house.right.a", "torch")]

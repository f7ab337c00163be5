"""The rules of the architecture themselves, on a made-up package."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

from helpers.import_rules import (
    Import,
    between_rooms,
    find_circle,
    forbidden,
    misplaced,
    not_pointing_down,
    read_imports,
    rooms_without_floor,
)

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

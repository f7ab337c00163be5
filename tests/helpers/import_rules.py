"""Who imports whom in a package, read from its source without running it, and what breaks rules."""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TypeAlias

Floors: TypeAlias = Sequence[Sequence[str]]


@dataclass(frozen=True)
class Import:
    """One module importing another; both by dotted name."""

    importer: str
    imported: str
    line: int

    def __str__(self) -> str:
        return f"{self.importer}:{self.line} imports {self.imported}"


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

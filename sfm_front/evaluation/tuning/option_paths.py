"""Options of a session by dotted path, such as ``guided.max_ratio``."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, TypeVar

from sfm_front.errors import ConfigError
from sfm_front.session.options import SessionOptions

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Value = bool | int | float | str

_Options = TypeVar("_Options", bound="DataclassInstance")

# Photos are described once for all values, and by VLAD alone.
DESCRIPTION = ("max_image_size", "max_features", "global_descriptor", "weights")


def paths(options: DataclassInstance, above: str = "") -> Iterator[str]:
    """The dotted paths of all options with a value of their own: no tuples, none that is unset."""
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            yield from paths(value, f"{above}{field.name}.")
        elif isinstance(value, Value):
            yield f"{above}{field.name}"


def check_path(path: str) -> None:
    """Raises ConfigError for one that is no option, or decides how photos are described."""
    if path in DESCRIPTION:
        raise ConfigError(f"{path}: decides how photos are described, which is done only once")
    known = list(paths(SessionOptions()))
    if path not in known:
        raise ConfigError(f"{path}: no such option; did you mean {nearest(path, known)}?")


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name that is most like this one, as a whole or in its last part."""

    def likeness(other: str) -> float:
        ends = (name.split(".")[-1], other.split(".")[-1])
        return max(
            difflib.SequenceMatcher(a=one, b=two).ratio() for one, two in ((name, other), ends)
        )

    return max(known, key=likeness)


def value_at(options: DataclassInstance, path: str) -> Value:
    """The value of the option at a path of ``paths``."""
    found: object = options
    for name in path.split("."):
        found = getattr(found, name)
    assert isinstance(found, Value)
    return found


def parse_value(path: str, text: str) -> Value:
    """A value as the option at ``path`` takes it. Raises ConfigError for one of another type."""
    kind = type(value_at(SessionOptions(), path))
    if kind is bool:
        if text not in ("true", "false"):
            raise ConfigError(f"{path}: true or false, got {text!r}")
        return text == "true"
    try:
        return kind(text)
    except ValueError:
        expected = "an integer" if kind is int else "a number"
        raise ConfigError(f"{path}: {expected}, got {text!r}") from None


def with_value(options: SessionOptions, path: str, value: Value) -> SessionOptions:
    """The options with one value replaced.

    Raises ConfigError for a value that cannot be, or that another option would overwrite.
    """
    try:
        changed = _replaced(options, path, value)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    if value_at(changed, path) != value:
        raise ConfigError(f"{path}: follows {path.split('.')[-1].removeprefix('num_')}; tune that")
    return changed


def _replaced(options: _Options, path: str, value: Value) -> _Options:
    name, _, below = path.partition(".")
    new = _replaced(getattr(options, name), below, value) if below else value
    return dataclasses.replace(options, **{name: new})

"""The options of a session as a TOML file: written with all values, read and checked.

A table of the file is a dataclass of the options, an array of tables a tuple of them. What a file
leaves out keeps its default. Options that several parts share, such as ``threads``, are set once:
the parts that take them from there have no such key.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, TypeVar, get_args, get_origin, get_type_hints

from sfm_front.errors import ConfigError, InputError
from sfm_front.session.options import SessionOptions

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_Options = TypeVar("_Options", bound="DataclassInstance")

TAKEN_FROM = {
    "sift.max_features": "max_features",
    "atlas.mapper.num_threads": "threads",
    "atlas.mapper.seed": "seed",
    "atlas.mapper.robust.num_threads": "threads",
    "atlas.mapper.robust.refine_intrinsics": "atlas.mapper.refine_intrinsics",
    "atlas.mapper.robust.large_from": "atlas.mapper.schedule.large_from",
    "atlas.localization.seed": "seed",
    "verification.seed": "seed",
}
"""Options that ``SessionOptions`` sets itself → the one it takes them from."""

_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t"}
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_LARGEST_INTEGER = 2**63 - 1


def as_toml(options: SessionOptions) -> str:
    """All options. What is not set is told in a comment: TOML has no value for it.

    ASCII, whatever the names in it, so that any shell can save it. Raises ConfigError for a path
    that is no Unicode.
    """
    return "\n".join(_lines(options, "")) + "\n"


def read_options(file: Path) -> SessionOptions:
    """The options of a file; paths in it are relative to the working folder.

    Raises InputError if it cannot be read or is no TOML, and ConfigError for a key or a value that
    cannot be. Both name the file.
    """
    try:
        # What Windows saves may begin with a byte-order mark.
        table = tomllib.loads(file.read_bytes().decode("utf-8-sig"))
    except FileNotFoundError:
        raise InputError(f"{file}: no such file; --print-config prints one to start from") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{file}: not UTF-8 at byte {error.start}") from None
    except RecursionError:
        raise InputError(f"{file}: not TOML: nested too deeply") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{file}: not TOML: {error}") from None
    try:
        return _built(SessionOptions, table, "", SessionOptions())
    except ConfigError as error:
        raise ConfigError(f"{file}: {error}") from None


# --- writing -------------------------------------------------------------------------------------


def _lines(options: DataclassInstance, name: str) -> Iterator[str]:
    """The lines of a table: its values first, as TOML wants it, then the tables in it."""
    tables: list[tuple[str, DataclassInstance, str]] = []
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        key = _dotted(name, field.name)
        if key in TAKEN_FROM:
            continue
        if value is None:
            yield f"# {field.name}: not set"
        elif dataclasses.is_dataclass(value) and not isinstance(value, type):
            tables.append((f"[{key}]", value, key))
        elif isinstance(value, tuple) and value and dataclasses.is_dataclass(value[0]):
            tables += [(f"[[{key}]]", element, key) for element in value]
        else:
            yield f"{field.name} = {_value(value, key)}"
    for header, table, key in tables:
        yield from ("", header)
        yield from _lines(table, key)


def _value(value: object, key: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str | Path):
        return f'"{"".join(_escaped(character, key) for character in str(value))}"'
    if isinstance(value, tuple):
        return f"[{', '.join(_value(element, key) for element in value)}]"
    raise TypeError(f"{key}: {type(value).__name__} cannot be written as TOML")


def _escaped(character: str, key: str) -> str:
    if character in _ESCAPES:
        return _ESCAPES[character]
    if " " <= character <= "~":
        return character
    code = ord(character)
    if 0xD800 <= code <= 0xDFFF:
        raise ConfigError(f"{key}: a name that is no Unicode cannot be written as TOML")
    return f"\\u{code:04X}" if code <= 0xFFFF else f"\\U{code:08X}"


# --- reading -------------------------------------------------------------------------------------


def _built(
    kind: type[_Options], table: Mapping[str, Any], name: str, base: _Options | None
) -> _Options:
    """Options of a kind; what the table leaves out is as in ``base``, or the kind's default."""
    types = get_type_hints(kind)
    values: dict[str, Any] = {}
    for key, value in table.items():
        full = _dotted(name, key)
        if full in TAKEN_FROM:
            raise ConfigError(f"{full}: set {TAKEN_FROM[full]} instead")
        if key not in types:
            raise ConfigError(f"{full}: no such key; did you mean {_nearest(key, name, kind)}?")
        values[key] = _read(types[key], value, full, getattr(base, key, None))
    if base is None:
        for field in dataclasses.fields(kind):
            if field.name in values or _has_default(field):
                continue
            if NoneType not in get_args(types[field.name]):
                raise ConfigError(f"{_dotted(name, field.name)}: missing")
            values[field.name] = None
    try:
        return kind(**values) if base is None else dataclasses.replace(base, **values)
    except ConfigError as error:
        raise ConfigError(f"{name}: {error}" if name else str(error)) from None


def _has_default(field: dataclasses.Field[Any]) -> bool:
    missing = dataclasses.MISSING
    return field.default is not missing or field.default_factory is not missing


def _read(declared: Any, value: object, key: str, base: object) -> object:
    """A value as its field declares it. Raises ConfigError for one of another type."""
    kind = declared
    if NoneType in get_args(declared):
        (kind,) = (part for part in get_args(declared) if part is not NoneType)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        if not isinstance(value, dict):
            raise _wrong_type(key, "a table", value)
        return _built(kind, value, key, base if isinstance(base, kind) else None)
    if get_origin(kind) is tuple:
        if not isinstance(value, list):
            raise _wrong_type(key, "an array", value)
        element = get_args(kind)[0]
        return tuple(_read(element, v, f"{key}#{n}", None) for n, v in enumerate(value, start=1))
    if kind is bool:
        if isinstance(value, bool):
            return value
        raise _wrong_type(key, "true or false", value)
    if kind is int:
        if _is_integer(value):
            return value
        raise _wrong_type(key, "an integer", value)
    if kind is float:
        if isinstance(value, int | float) and (_is_integer(value) or _is_float(value)):
            return float(value)
        raise _wrong_type(key, "a number", value)
    if isinstance(value, str):
        return Path(value) if kind is Path else value
    raise _wrong_type(key, "text in quotes", value)


def _is_integer(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= _LARGEST_INTEGER


def _is_float(value: object) -> bool:
    return isinstance(value, float) and not math.isnan(value)


def _wrong_type(key: str, expected: str, value: object) -> ConfigError:
    if isinstance(value, dict | list):
        shown = "a table" if isinstance(value, dict) else "an array"
    elif isinstance(value, str):
        shown = repr(value)
    else:
        shown = str(value).lower()
    return ConfigError(f"{key}: must be {expected}, got {shown}")


def _nearest(key: str, name: str, kind: type[DataclassInstance]) -> str:
    """The known key that is most like an unknown one: in its table, else of its name elsewhere."""
    siblings = [
        field.name
        for field in dataclasses.fields(kind)
        if _dotted(name, field.name) not in TAKEN_FROM
    ]
    close = difflib.get_close_matches(key, siblings, n=1)
    elsewhere = [known for known in _known(SessionOptions, "") if known.split(".")[-1] == key]
    if elsewhere and not close:
        return elsewhere[0]
    return _dotted(name, (close or difflib.get_close_matches(key, siblings, n=1, cutoff=0))[0])


def _known(kind: type[DataclassInstance], name: str) -> Iterator[str]:
    """The full names of all keys, without those of arrays of tables."""
    for key, declared in get_type_hints(kind).items():
        full = _dotted(name, key)
        if full not in TAKEN_FROM:
            yield full
        if dataclasses.is_dataclass(declared) and isinstance(declared, type):
            yield from _known(declared, full)


def _dotted(name: str, key: str) -> str:
    shown = key if _BARE_KEY.fullmatch(key) else repr(key)
    return f"{name}.{shown}" if name else shown

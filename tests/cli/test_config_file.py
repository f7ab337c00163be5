"""The options as TOML: what is printed is read back, and what cannot be is refused by name."""

from __future__ import annotations

import dataclasses
import re
import sys
from dataclasses import replace
from pathlib import Path
from types import NoneType
from typing import get_args, get_type_hints

import pytest

from sfm_front.cli.config_file import TAKEN_FROM, as_toml, read_options
from sfm_front.errors import ConfigError, InputError
from sfm_front.mapping.initialization import ConstraintLevel, InitializationOptions
from sfm_front.mapping.mapper_options import InitialPairConstraints
from sfm_front.matching.guided_matching import GuidedOptions
from sfm_front.matching.nearest_neighbors import MatchingOptions
from sfm_front.photos.cameras import CameraOptions
from sfm_front.photos.positions import PositionOptions
from sfm_front.session.options import SessionOptions

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

DEFAULT = SessionOptions()


def with_levels(*levels: ConstraintLevel) -> SessionOptions:
    initialization = InitializationOptions(constraint_levels=levels)
    return SessionOptions(atlas=replace(DEFAULT.atlas, initialization=initialization))


CHANGED = {
    "default": DEFAULT,
    "values of each type": SessionOptions(
        max_features=17,
        device="cpu",
        text=True,
        threads=DEFAULT.threads + 1,
        seed=9,
        weights=Path('süd flug ✈ 🛩/a "b" c\\d\t\n\x7f.pth'),
        cameras=CameraOptions(mode="single", params=(1e3, 500.25, 1e-7, 0.0)),
        positions=PositionOptions(source="süd/geo.txt", horizontal_sigma_m=0.02),
    ),
    "numbers TOML spells apart": SessionOptions(
        matching=MatchingOptions(max_angle_rad=1e22),
        guided=GuidedOptions(max_ratio=1e-9),
    ),
    "infinite": SessionOptions(matching=MatchingOptions(max_angle_rad=float("inf"))),
    "no levels": with_levels(),
    "levels of its own": with_levels(
        ConstraintLevel(
            min_waiting=3, constraints=InitialPairConstraints(min_angle_deg=2.5, min_inliers=9)
        ),
        ConstraintLevel(
            min_waiting=None, constraints=InitialPairConstraints(min_angle_deg=1, min_inliers=8)
        ),
    ),
    "one value deep inside": SessionOptions(
        atlas=replace(
            DEFAULT.atlas,
            mapper=replace(
                DEFAULT.atlas.mapper, schedule=replace(DEFAULT.atlas.mapper.schedule, growth=1.5)
            ),
        )
    ),
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "options.toml"


def leaves(value: object, name: str = "") -> dict[str, object]:
    """Every value of nested options by its dotted name."""
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return {name: value}
    found: dict[str, object] = {}
    for field in dataclasses.fields(value):
        dotted = f"{name}.{field.name}" if name else field.name
        found |= leaves(getattr(value, field.name), dotted)
    return found


def kinds(kind: type) -> list[type]:
    """This dataclass and all those in it."""
    found = [kind]
    for declared in get_type_hints(kind).values():
        for part in (declared, *get_args(declared)):
            if dataclasses.is_dataclass(part):
                found += kinds(part)
    return found


@pytest.mark.parametrize("name", CHANGED)
def test_what_is_printed_is_read_back(file, name):
    text = as_toml(CHANGED[name])
    assert text.isascii()
    file.write_text(text)
    assert read_options(file) == CHANGED[name]


def test_all_is_printed_but_what_is_set_at_the_top():
    printed = tomllib.loads(as_toml(DEFAULT))
    for name, value in leaves(DEFAULT).items():
        table, _, key = name.rpartition(".")
        found = printed
        for part in filter(None, table.split(".")):
            found = found[part]
        assert (key in found) == (value is not None and name not in TAKEN_FROM), name
    assert "# weights: not set" in as_toml(DEFAULT).splitlines()


def test_what_is_set_at_the_top_is_what_the_session_sets_itself():
    for name, change in {"seed": {"seed": 7}, "threads": {"threads": DEFAULT.threads + 1}}.items():
        before, after = leaves(DEFAULT), leaves(SessionOptions(**change))
        changed = {key for key in before if before[key] != after[key]} - {name}
        assert changed == {key for key, top in TAKEN_FROM.items() if top == name}


def test_whatever_may_be_unset_is_so_where_a_file_leaves_it_out():
    """Else the comment that is printed for it would be read as another value."""
    for kind in kinds(SessionOptions):
        types = get_type_hints(kind)
        for field in dataclasses.fields(kind):
            if NoneType in get_args(types[field.name]):
                assert field.default in (None, dataclasses.MISSING), (kind, field.name)
                assert field.default_factory is dataclasses.MISSING


def test_what_a_file_leaves_out_keeps_its_default(file):
    file.write_text("[second_rerank]\n[retrieval]\nnum_expansion = 1\n[atlas.mapper.schedule]\n")
    retrieval = replace(DEFAULT.retrieval, num_expansion=1)
    assert read_options(file) == replace(DEFAULT, retrieval=retrieval)


def test_seed_and_threads_reach_every_part(file):
    file.write_text("seed = 5\nthreads = 3\n[atlas]\nmin_share = 0.5\n")
    options = read_options(file)
    assert (options.verification.seed, options.atlas.localization.seed) == (5, 5)
    assert (options.atlas.mapper.seed, options.atlas.mapper.num_threads) == (5, 3)
    assert options.atlas.min_share == 0.5


def test_an_integer_is_a_number(file):
    file.write_text("[verification]\nmax_error_px = 3\n")
    value = read_options(file).verification.max_error_px
    assert (value, type(value)) == (3.0, float)


def test_a_byte_order_mark_and_windows_line_ends(file):
    file.write_bytes(b"\xef\xbb\xbfseed = 4\r\ntext = true\r\n")
    assert read_options(file) == SessionOptions(seed=4, text=True)


LEVEL = "[[atlas.initialization.constraint_levels]]\n"
GOOD_LEVEL = f"{LEVEL}constraints = {{min_angle_deg = 1, min_inliers = 9}}\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("max_feature = 5", "max_feature: no such key; did you mean max_features?"),
        ("[guided]\nmax_rato = 1", "guided.max_rato: no such key; did you mean guided.max_ratio?"),
        ("candidates = 5", "candidates: no such key; did you mean retrieval.candidates?"),
        ("[gided]", "gided: no such key; did you mean guided?"),
        ("[rerank]\nx = 1", "rerank.x: no such key; did you mean rerank.max_features?"),
        ('"a\\nb" = 1', r"'a\nb': no such key"),
        (
            f"{GOOD_LEVEL}{LEVEL}min_wait = 1",
            "atlas.initialization.constraint_levels#2.min_wait: no such key; did you mean "
            "atlas.initialization.constraint_levels#2.min_waiting?",
        ),
        ("[verification]\nseed = 1", "verification.seed: set seed instead"),
        ("[atlas.mapper]\nnum_threads = 1", "atlas.mapper.num_threads: set threads instead"),
        ("max_features = 1.0", "max_features: must be an integer, got 1.0"),
        ("max_features = true", "max_features: must be an integer, got true"),
        ("max_features = 9223372036854775808", "max_features: must be an integer, got 92"),
        ('max_features = "1"', "max_features: must be an integer, got '1'"),
        ("text = 1", "text: must be true or false, got 1"),
        ("device = 1", "device: must be text in quotes, got 1"),
        ("weights = []", "weights: must be text in quotes, got an array"),
        ("guided = 1", "guided: must be a table, got 1"),
        ("[guided]\nmax_ratio = true", "guided.max_ratio: must be a number, got true"),
        ("[guided]\nmax_ratio = nan", "guided.max_ratio: must be a number, got nan"),
        ("[cameras]\nmode = 1", "cameras.mode: must be text in quotes, got 1"),
        ("[cameras]\nparams = 1", "cameras.params: must be an array, got 1"),
        ("[cameras]\nparams = [1, '2']", "cameras.params#2: must be a number, got '2'"),
        (
            "[atlas.initialization]\nconstraint_levels = {}",
            "atlas.initialization.constraint_levels: must be an array, got a table",
        ),
        (
            "[atlas.initialization]\nconstraint_levels = [1]",
            "atlas.initialization.constraint_levels#1: must be a table, got 1",
        ),
        (f"{LEVEL}", "atlas.initialization.constraint_levels#1.constraints: missing"),
        ("threads = 0", "threads must be at least 1, got 0"),
        ("max_features = 0", "max_features must be at least 1, got 0"),
        ("[guided]\nmax_ratio = 2", "guided: max_ratio must be above 0 and at most 1, got 2"),
        ('[cameras]\nmode = "one"', "cameras: camera mode must be one of auto, single"),
        ("[atlas.mapper]\nretry_growth = 0", "atlas.mapper: retry_growth must be at least 1"),
    ],
)
def test_a_key_or_value_that_cannot_be(file, text, message):
    file.write_text(text)
    with pytest.raises(ConfigError) as refused:
        read_options(file)
    assert str(refused.value).startswith(f"{file}: {message}")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"seed = 1\nthreads = = 2\n", r"not TOML: .*line 2, column 11"),
        (b"seed = 1\nseed = 2\n", r"not TOML: .*line 2"),
        (b"seed", "not TOML: .*"),
        (b"a = " + b"[" * 100_000, "not TOML: .*nested.*"),
        (b"\xff\xfes\0", "not UTF-8 at byte 0"),
    ],
)
def test_a_file_that_is_no_toml(file, content, message):
    file.write_bytes(content)
    with pytest.raises(InputError) as refused:
        read_options(file)
    assert re.match(re.escape(f"{file}: ") + message, str(refused.value))
    assert "\n" not in str(refused.value)


def test_a_file_that_is_missing_or_a_folder(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: no such file"):
        read_options(tmp_path / "none.toml")
    with pytest.raises(InputError, match="cannot be read"):
        read_options(tmp_path)


def test_a_path_that_is_no_unicode_is_refused():
    with pytest.raises(ConfigError, match="weights: "):
        as_toml(SessionOptions(weights=Path("\udcff.pth")))

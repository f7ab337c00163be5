"""What README and guides tell readers to type: it is understood, and what is quick is run."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from helpers.locations import ROOT, SCRIPTS, VILLAGE

from sfm_front.cli.guide import read_guides
from sfm_front.cli.main import main, make_parser

GUIDES = sorted((ROOT / "sfm_front" / "guides").glob("*.md"))
PAGES = [ROOT / "README.md", SCRIPTS / "README.md", *GUIDES]
# A reconstruction that takes seconds, and never looks for weights.
QUICK = "--max-image-size 640 --max-features 1500 --global-descriptor vlad --threads 2"
PHOTOS = ("a", "b", "c", "d", "e", "f")
# What needs files that only readers have, or does not end by itself; exports have a test of their
# own, which looks at what comes out.
NOT_RUN = re.compile(
    r"--watch$|--viewer|--web|--gps (positions|geo)|--gcp|--ground-truth|--camera-params"
    r"|--cluster tcp|path/to/photos|^sfm-front view \S+$|^sfm-front export|^sfm-front --print"
)


@dataclass(frozen=True)
class Line:
    """A command on a page."""

    page: str
    text: str

    def __str__(self) -> str:
        return f"{self.page}: {self.text}"

    @property
    def arguments(self) -> list[str]:
        return shlex.split(re.sub(r" > .*$", "", self.text))


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)


def lines(begin: str) -> Iterator[Line]:
    for page in PAGES:
        for block in blocks(page, "sh"):
            for text in block.replace("\\\n", " ").splitlines():
                if text.startswith(begin):
                    bare = re.sub(r"  +#.*$", "", text)
                    yield Line(page.relative_to(ROOT).as_posix(), bare)


COMMANDS = list(lines("sfm-front "))
SCRIPT_COMMANDS = list(lines("python scripts/"))


def test_there_is_something_to_test():
    assert len(COMMANDS) > 30
    assert len(SCRIPT_COMMANDS) > 10
    assert set(read_guides()) == {page.stem for page in GUIDES}


@pytest.mark.parametrize("page", [*PAGES, *ROOT.glob("*/README.md")], ids=str)
def test_links_lead_somewhere(page):
    for target, anchor in re.findall(r"\]\(([^):#]*)(?:#([^)]*))?\)", page.read_text("utf-8")):
        file = page.parent / target if target else page
        assert file.exists(), target
        if anchor:
            titles = re.findall(r"^#+ (.*)$", file.read_text("utf-8"), re.M)
            assert anchor in [re.sub(r"[^\w -]", "", t.lower()).replace(" ", "-") for t in titles]


@pytest.mark.parametrize("line", COMMANDS, ids=str)
def test_a_command_is_understood(line, capsys):
    mistake = None
    try:
        make_parser().parse_args(line.arguments[1:])
    except SystemExit as left:  # 0 of --print-completion and --help
        mistake = left.code
    assert not mistake, capsys.readouterr().err


@pytest.mark.parametrize("line", SCRIPT_COMMANDS, ids=str)
def test_a_script_understands_its_arguments(line, monkeypatch, tmp_path):
    _, script, *given = line.arguments
    parse = runpy.run_path(str(ROOT / script)).get("parse")
    if parse is None:  # An example: its own test runs it.
        assert (ROOT / script).is_file()
        return
    monkeypatch.chdir(tmp_path)
    # An optional part in brackets, and folders of the reader's.
    assert parse([argument.strip("[].") for argument in given])


@pytest.fixture(scope="module")
def desk(tmp_path_factory) -> Path:
    """Where a reader is: photos, a second flight, and a finished reconstruction of both names."""
    desk = tmp_path_factory.mktemp("desk")
    taken = sorted((VILLAGE / "images").iterdir())
    (desk / "photos").mkdir()
    (desk / "flight2").mkdir()
    for name, photo in zip(PHOTOS, taken, strict=False):
        shutil.copy(photo, desk / "photos" / f"{name}.jpg")
    for photo in taken[6:8]:
        shutil.copy(photo, desk / "flight2" / photo.name)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(desk)
        for output in ("outputs/photos", "outputs/flight"):
            assert main(["reconstruct", "photos", "--output", output, *QUICK.split()]) == 0
    return desk


@pytest.mark.slow
@pytest.mark.parametrize("line", [c for c in COMMANDS if not NOT_RUN.search(c.text)], ids=str)
def test_a_command_runs(desk, line, tmp_path, monkeypatch, capsys):
    shutil.copytree(desk / "outputs", tmp_path / "outputs")
    for folder in ("photos", "flight2"):  # The outputs know where they are.
        (tmp_path / folder).symlink_to(desk / folder)
    monkeypatch.chdir(tmp_path)
    _, command, *given = line.arguments
    if command == "reconstruct":
        given += QUICK.split()
        if "--config" in given:
            main(["reconstruct", "--print-config"])
            (tmp_path / "options.toml").write_text(capsys.readouterr().out)
        if "--idle-timeout" in given:
            given[given.index("--idle-timeout") + 1] = "2"
    elif command == "retrieve":
        given += QUICK.split()
    assert main([command, *given]) == 0, capsys.readouterr().err


PYTHON = [(page.relative_to(ROOT).as_posix(), blocks(page, "python")) for page in PAGES]


@pytest.mark.slow
@pytest.mark.parametrize(("page", "code"), [row for row in PYTHON if row[1]])
def test_python_runs_from_top_to_bottom(desk, page, code, tmp_path, monkeypatch, capsys):
    (tmp_path / "photos").symlink_to(desk / "photos")
    monkeypatch.chdir(tmp_path)
    for block in code:
        exec(compile(block, page, "exec"), {"__name__": page})
    assert capsys.readouterr().out != ""

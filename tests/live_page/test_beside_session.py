"""The page's process: it tells its address, and ends with its session."""

from __future__ import annotations

import shutil
import time
import urllib.request
from collections.abc import Callable

import pytest
from helpers.locations import VILLAGE

from sfm_front.cli.main import main
from sfm_front.live_page.beside_session import PageBesideSession
from sfm_front.live_page.extra import is_installed
from sfm_front.storage.watched_mark import is_watched

pytestmark = pytest.mark.skipif(not is_installed(), reason="needs viser: pip install viser")


def wait_for(what: Callable[[], bool]) -> None:
    until = time.monotonic() + 60
    while not what():
        assert time.monotonic() < until, "waited in vain"
        time.sleep(0.05)


def test_it_tells_its_address_and_ends_when_nobody_looks(tmp_path):
    said: list[str] = []
    with PageBesideSession(tmp_path / "out", said.append, 18280) as page:
        wait_for(lambda: len(said) == 1)
        address = said[0].removeprefix("live page: ")
        assert address.startswith("http://127.0.0.1:182")
        assert urllib.request.urlopen(address, timeout=10).status == 200
        page.stay()
        wait_for(lambda: page._process.poll() is not None)
    assert page._process.returncode == 0


def test_it_ends_with_its_session(tmp_path):
    said: list[str] = []
    with PageBesideSession(tmp_path / "out", said.append, 18280) as page:
        wait_for(lambda: len(said) == 1)
        # As the system does when the session's process is killed.
        page._process.stdin.close()
        wait_for(lambda: page._process.poll() is not None)
    assert page._process.returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize("quiet", [(), ("--quiet",)])
def test_a_run_with_the_page_on_says_where_it_is_and_ends(tmp_path, capfd, quiet):
    folder = tmp_path / "photos"
    folder.mkdir()
    for photo in sorted((VILLAGE / "images").iterdir())[:4]:
        shutil.copy(photo, folder / photo.name)
    small = ["--max-image-size", "480", "--max-features", "900", "--global-descriptor", "vlad"]
    output = tmp_path / "out"
    run = ["reconstruct", str(folder), "--output", str(output), "--viewer", *small, *quiet]
    assert main(run) in (0, 1)
    assert capfd.readouterr().out.count("live page: http://127.0.0.1:") == 1
    assert not is_watched(output)

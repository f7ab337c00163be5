"""The page's process: it tells its address, and ends with its session."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable

import pytest
from helpers.live_session import orbit, photos_of, run_session
from helpers.locations import ROOT, VILLAGE

from sfm_front.cli.main import main
from sfm_front.live_page import beside_session
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
        page.stay(lambda: False)
        wait_for(lambda: page._process.poll() is not None)
    assert page._process.returncode == 0


def test_it_ends_with_its_session_where_nobody_looks(tmp_path):
    said: list[str] = []
    with PageBesideSession(tmp_path / "out", said.append, 18280) as page:
        wait_for(lambda: len(said) == 1)
        # As the system does when the session's process is killed.
        page._process.stdin.close()
        wait_for(lambda: page._process.poll() is not None)
    assert page._process.returncode == 0


def test_while_a_browser_shows_it_it_stays_until_ctrl_c(tmp_path, monkeypatch):
    # Too short for the page to see that there is no browser.
    monkeypatch.setattr(beside_session, "_ENDING_S", 0.01)
    said: list[str] = []
    with PageBesideSession(tmp_path / "out", said.append, 18280) as page:
        wait_for(lambda: len(said) == 1)
        page.stay(lambda: True)
        assert "Ctrl-C" in said[1]


def test_a_page_that_cannot_start_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    said: list[str] = []
    with PageBesideSession(tmp_path / "out", said.append, 18280):
        wait_for(lambda: len(said) == 1)
    assert said == [f"no live page: sfm-front view {tmp_path / 'out'} --web says why"]


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_ctrl_c_is_how_view_ends(tmp_path, name):
    output = run_session(tmp_path / "out", photos_of(orbit(4), tmp_path / "photos"))
    command = [sys.executable, str(ROOT / "scripts" / "view.py"), str(output), "--web"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert "Ctrl-C ends it" in process.stdout.readline()
        process.send_signal(getattr(signal, name))
        assert process.wait(60) == 0
        assert process.stderr.read().strip() == "closing the live page"


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

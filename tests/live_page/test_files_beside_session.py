"""The report beside a session: when it is written, and that it stays away at the end."""

from __future__ import annotations

import time
from contextlib import closing
from itertools import islice

import pytest
from helpers.live_session import orbit, photos_of
from helpers.positioned_stream import options

from sfm_front.live_page import files_beside_session as beside_session
from sfm_front.live_page.extra import is_installed
from sfm_front.live_page.files_beside_session import FilesBesideSession
from sfm_front.session.session import Session

PATIENCE_S = 60.0


def wait_for(what) -> None:
    until = time.monotonic() + PATIENCE_S
    while not what():
        assert time.monotonic() < until
        time.sleep(0.02)


@pytest.mark.slow
def test_the_page_follows_the_models(tmp_path, monkeypatch):
    monkeypatch.setattr(beside_session, "_MAX_SHARE", 1.0)
    output = tmp_path / "out"
    page = output / "report.html"
    photos = photos_of(orbit(24), tmp_path / "photos")
    with Session(output, options()) as session, FilesBesideSession(output, every_s=0.05):
        for photo in islice(photos, 6):
            session.add_extracted(photo)
        session._write_snapshot()
        wait_for(page.exists)
        assert "Not finished yet" in page.read_text(encoding="utf-8")
        assert (output / "scene.html").exists() == is_installed()
        session.add_extracted(next(photos))
        session._write_snapshot()
        wait_for(lambda: "7 / 7" in page.read_text(encoding="utf-8"))


class Processes:
    """Stand-ins that last ``lasting_s`` and say to have worked ``spent_s``; when they began."""

    def __init__(self, monkeypatch, lasting_s: float = 0.0, spent_s: float = 0.0) -> None:
        self.began: list[float] = []
        self.killed = 0
        processes = self

        class Process:
            def __init__(self, *_: object, **__: object) -> None:
                processes.began.append(time.monotonic())
                self._ends = time.monotonic() + lasting_s

            def poll(self) -> int | None:
                return 0 if time.monotonic() >= self._ends else None

            def kill(self) -> None:
                processes.killed += 1
                self._ends = 0.0

            def wait(self) -> None: ...

            def communicate(self) -> tuple[bytes, None]:
                return b"%.3f\n" % spent_s, None

        monkeypatch.setattr(beside_session.subprocess, "Popen", Process)
        monkeypatch.setattr(beside_session, "_TICK_S", 0.01)


@pytest.fixture
def output(tmp_path):
    (tmp_path / "sparse").mkdir()
    return tmp_path


def write_models(output, number: int) -> None:
    (output / "sparse" / "session.json").write_text(str(number))


def test_without_new_models_nothing_is_written(output, monkeypatch):
    processes = Processes(monkeypatch)
    write_models(output, 1)
    with closing(FilesBesideSession(output, every_s=0.02)):
        time.sleep(0.2)
        assert not processes.began
        write_models(output, 2)
        wait_for(lambda: processes.began)
        time.sleep(0.2)
        assert len(processes.began) == 1


def test_a_page_that_takes_long_comes_seldom(output, monkeypatch):
    processes = Processes(monkeypatch, spent_s=0.1)
    monkeypatch.setattr(beside_session, "_MAX_SHARE", 0.2)
    with closing(FilesBesideSession(output, every_s=0.02)):
        number = 0
        while len(processes.began) < 3:
            write_models(output, number := number + 1)
            time.sleep(0.02)
    assert min(b - a for a, b in zip(processes.began, processes.began[1:], strict=False)) >= 0.5


def test_at_the_end_it_leaves_at_once_and_without_a_trace(output, monkeypatch):
    processes = Processes(monkeypatch, 1e6)
    report = FilesBesideSession(output, every_s=0.02)
    write_models(output, 1)
    wait_for(lambda: processes.began)
    (output / ".report.html.abcd1234").touch()
    report.close()
    assert processes.killed == 1
    assert [path.name for path in output.iterdir()] == ["sparse"]

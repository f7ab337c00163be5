"""A line that goes on while nothing of Python can run in the process that said it."""

from __future__ import annotations

import ctypes
import os
import re
import select
import sys
import time
from pathlib import Path

import pytest

from sfm_front.cli.heartbeat import Heartbeat

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo terminals"),
]


def read(file: int) -> str:
    """What has come so far."""
    data = b""
    while select.select([file], [], [], 0.1)[0]:
        data += os.read(file, 4096)
    return data.decode()


@pytest.fixture
def terminal():
    """The end that a user sees, and the stream that the program writes to."""
    seen, written = os.openpty()
    with os.fdopen(written, "w", encoding="utf-8") as stream:
        yield seen, stream
    os.close(seen)


def test_it_goes_on_while_the_interpreter_is_locked(terminal):
    seen, stream = terminal
    heartbeat = Heartbeat(stream)
    heartbeat.say("finishing: last adjustment")
    # Unlike CDLL, this calls with the interpreter's lock held, as COLMAP's adjustment does.
    ctypes.PyDLL(None).sleep(4)
    heartbeat.stop()
    lines = read(seen).split("\r\x1b[K")[1:]
    assert re.fullmatch(r"finishing: last adjustment … 0:0\d", lines[0])
    assert len(lines) >= 2
    assert lines == sorted(set(lines))


def test_nothing_comes_any_more_once_it_is_stopped(terminal):
    seen, stream = terminal
    heartbeat = Heartbeat(stream)
    heartbeat.say("finishing")
    heartbeat.stop()
    time.sleep(2.5)
    assert read(seen) == ""


def test_where_there_is_no_file_there_is_none():
    heartbeat = Heartbeat(sys.stdin)  # pytest's, which has no file
    heartbeat.say("finishing")
    heartbeat.stop()


def test_a_log_is_not_filled(tmp_path: Path):
    file = tmp_path / "log"
    with file.open("w") as stream:
        heartbeat = Heartbeat(stream)
        heartbeat.say("finishing", is_long=True)
        time.sleep(2.5)
        heartbeat.stop()
    assert file.read_text() == ""

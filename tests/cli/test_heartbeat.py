"""A line that goes on while nothing of Python can run in the process that said it."""

from __future__ import annotations

import ctypes
import os
import re
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sfm_front.cli.heartbeat import Heartbeat
from sfm_front.runtime.subprocess_env import module_environment

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


def runs(pid: int) -> bool:
    """On Linux; a process that nobody has asked for its status does not run."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


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


def test_ctrl_c_is_for_the_run(terminal):
    seen, stream = terminal
    heartbeat = Heartbeat(stream)
    heartbeat.say("finishing")
    time.sleep(1.0)
    process = heartbeat._process
    assert process is not None
    # One job of the shell: what stops the run stops this, too.
    assert os.getpgid(process.pid) == os.getpgid(0)
    process.send_signal(signal.SIGINT)
    time.sleep(2.0)
    assert "finishing … 0:0" in read(seen)
    heartbeat.stop()


def test_it_ends_with_its_process(tmp_path):
    file = tmp_path / "pid"
    code = (
        "import os, pathlib; from sfm_front.cli.heartbeat import Heartbeat;"
        "beat = Heartbeat(open(os.devnull, 'w')); beat.say('finishing');"
        f"pathlib.Path({str(file)!r}).write_text(str(beat._process.pid)); os.abort()"
    )
    subprocess.run([sys.executable, "-c", code], env=module_environment(), check=False)
    pid, deadline = int(file.read_text()), time.monotonic() + 10
    while runs(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not runs(pid)


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

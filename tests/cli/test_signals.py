"""The first signal may ask, one too many ends the process, whatever the main thread does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers.locations import ROOT
from helpers.signal_handlers import default_handlers

from sfm_front.cli.signals import leaving_at_signal

SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")

# In a process of its own: what a signal ends must not be the tests.
BEGIN = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)
for name in ("SIGTERM", "SIGHUP"):
    signal.signal(getattr(signal, name), signal.SIG_DFL)
def send(name):
    signal.raise_signal(getattr(signal, name))
"""

# Sends a signal when a module is about to be imported, and keeps the main thread busy then.
AT_IMPORT = """
class Sender:
    def find_spec(self, name, path, target=None):
        if name == sys.argv[2]:
            send(sys.argv[1])
            time.sleep(600)
sys.meta_path.insert(0, Sender())
from sfm_front.cli import main
sys.exit(main(["reconstruct", *sys.argv[3:]]))
"""

WITHIN = """
from sfm_front.cli.signals import leaving_at_signal
with leaving_at_signal(2, "stopping"):
    send(sys.argv[1])
    send(sys.argv[2])
    time.sleep(600)
"""

BUSY = """
from sfm_front.cli.signals import leaving_at_signal
with leaving_at_signal(2, "stopping"):
    print("ready", flush=True)
    sum(range(10**14))
"""


def run(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", BEGIN + code, *arguments],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    with default_handlers():
        yield


@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize(
    "module", ["argparse", "sfm_front.cli.reconstruct", "numpy", "sfm_front.session.session"]
)
def test_while_modules_are_imported_a_signal_is_one_line(tmp_path, name, module):
    folder, output = tmp_path / "photos", tmp_path / "out"
    folder.mkdir()
    (folder / "a.jpg").touch()
    done = run(AT_IMPORT, name, module, str(folder), "--output", str(output))
    status = 128 + getattr(signal, name)
    assert (done.returncode, done.stdout, done.stderr) == (status, "", "\ninterrupted\n")
    assert not output.exists()


@pytest.mark.parametrize("second", ["SIGTERM", "SIGHUP"])
def test_the_second_ends_a_process_whose_main_thread_waits(second):
    done = run(WITHIN, "SIGINT", second)
    status = 128 + getattr(signal, second)
    assert (done.returncode, done.stderr) == (status, "\nstopping\n\ninterrupted\n")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere it ends when the call returns")
@pytest.mark.parametrize("name", SIGNALS)
def test_the_second_ends_a_process_that_lets_no_python_run(name):
    """As while COLMAP refines: a sum in C keeps the interpreter's lock all the time."""
    with subprocess.Popen(
        [sys.executable, "-c", BEGIN + BUSY],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout.readline() == "ready\n"
        number = getattr(signal, name)
        for _ in range(2):
            process.send_signal(number)
            while process.poll() is None and is_pending(process.pid, number):
                pass
        assert process.wait() == -number


def is_pending(pid: int, number: int) -> bool:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    masks = [int(line.split()[1], 16) for line in lines if line.startswith(("SigPnd", "ShdPnd"))]
    return any(mask >> (number - 1) & 1 for mask in masks)


@pytest.mark.parametrize("name", SIGNALS)
def test_the_first_only_asks(capfd, name):
    number = getattr(signal, name)
    before = signal.getsignal(number)
    with leaving_at_signal(2, "stopping") as came:
        assert not came()
        signal.raise_signal(number)
        assert came()
    assert capfd.readouterr().err == "\nstopping\n"
    assert signal.getsignal(number) is before


def test_what_was_ignored_stays_so(capfd):
    """As SIGHUP is under nohup."""
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with leaving_at_signal(1) as came:
        signal.raise_signal(signal.SIGHUP)
        assert not came()
    assert capfd.readouterr().err == ""
    assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN


def test_within_another_the_inner_one_counts(capfd):
    with leaving_at_signal(2, "outer") as outer:
        with leaving_at_signal(2, "inner") as inner:
            signal.raise_signal(signal.SIGTERM)
        assert (outer(), inner()) == (False, True)
        signal.raise_signal(signal.SIGTERM)
        assert outer()
    assert capfd.readouterr().err == "\ninner\n\nouter\n"


def test_other_signals_do_not_count(capfd):
    before = signal.signal(signal.SIGUSR1, lambda _number, _frame: None)
    try:
        with leaving_at_signal(1) as came:
            signal.raise_signal(signal.SIGUSR1)
            assert not came()
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert capfd.readouterr().err == ""

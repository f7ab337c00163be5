"""Printing that never fails: closed pipes, full disks, encodings that lack characters."""

from __future__ import annotations

import errno
import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.locations import ROOT

from sfm_front.cli import retrieve
from sfm_front.cli.main import main
from sfm_front.cli.streams import unfailing_streams

FULL = Path("/dev/full")
needs_full_device = pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")


def broken_pipe() -> io.TextIOWrapper:
    receiver, sender = os.pipe()
    os.close(receiver)
    return io.TextIOWrapper(io.BufferedWriter(io.FileIO(sender, "wb")))


@pytest.mark.parametrize("encoding", ["ascii", "iso-8859-1", "utf-8"])
def test_help_is_printed_in_any_encoding(encoding):
    done = subprocess.run(
        [sys.executable, "scripts/reconstruct.py", "--help"],
        cwd=ROOT,
        env=os.environ | {"PYTHONIOENCODING": encoding},
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert "F,CX,CY,…".encode(encoding, "replace") in done.stdout


def test_characters_that_an_encoding_lacks_are_replaced(tmp_path, monkeypatch):
    file = tmp_path / "log.txt"
    with file.open("w", encoding="ascii") as log:
        monkeypatch.setattr(sys, "stdout", log)
        with unfailing_streams():
            print("süd → \udce4.jpg")
        assert sys.stdout is log
    assert file.read_bytes() == b"s?d ? ?.jpg\n"


def test_a_closed_pipe_is_nothing_to_tell(monkeypatch):
    with broken_pipe() as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        with unfailing_streams() as why_incomplete:
            for _ in range(3):
                print("x" * 100_000, flush=True)
            assert why_incomplete() is None


@needs_full_device
def test_a_full_disk_is_the_reason(monkeypatch):
    with FULL.open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        with unfailing_streams() as why_incomplete:
            assert why_incomplete() is None
            print("x")
            assert why_incomplete().errno == errno.ENOSPC


def test_a_stream_that_was_closed_before_takes_all(monkeypatch):
    monkeypatch.setattr(sys, "stdout", None)
    with unfailing_streams() as why_incomplete:
        assert not sys.stdout.isatty()
        print("x")
        assert why_incomplete() is None
    assert sys.stdout is None


@needs_full_device
def test_an_answer_that_is_lost_is_told(monkeypatch, capsys):
    monkeypatch.setattr(retrieve, "run", lambda _arguments: print("answer") or 0)
    with FULL.open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main(["retrieve", "folder", "--query", "photo"]) == 1
    told = capsys.readouterr().err
    assert told == "sfm-front: standard output is incomplete (No space left on device)\n"


def test_an_answer_that_nobody_reads_is_no_error(monkeypatch, capsys):
    monkeypatch.setattr(retrieve, "run", lambda _arguments: print("answer") or 0)
    with broken_pipe() as pipe:
        monkeypatch.setattr(sys, "stdout", pipe)
        assert main(["retrieve", "folder", "--query", "photo"]) == 0
    assert capsys.readouterr().err == ""

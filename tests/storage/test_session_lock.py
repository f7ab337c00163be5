"""One writer per folder, whatever the order in which processes come and go."""

from __future__ import annotations

import subprocess
import sys
from threading import Event, Thread

import pytest

from sfm_front.errors import InputError
from sfm_front.storage.session_lock import LOCK, OWNER, SessionLock, is_locked


def test_a_lock_taken_at_the_very_end_of_another_is_kept(tmp_path, monkeypatch):
    first = SessionLock(tmp_path)
    release = first._lock.release
    second: list[SessionLock] = []

    def release_and_lose_the_race() -> None:
        release()
        second.append(SessionLock(tmp_path))

    monkeypatch.setattr(first._lock, "release", release_and_lose_the_race)
    first.close()
    with pytest.raises(InputError, match="is writing to it"):
        SessionLock(tmp_path)
    second[0].close()
    SessionLock(tmp_path).close()


def test_a_lock_whose_owner_cannot_be_written_holds(tmp_path):
    (tmp_path / OWNER).mkdir()
    with (
        SessionLock(tmp_path),
        pytest.raises(InputError, match="another process is writing to it"),
    ):
        SessionLock(tmp_path)


def test_nothing_is_left_of_a_lock(tmp_path):
    with SessionLock(tmp_path):
        assert list(tmp_path.iterdir())
    assert list(tmp_path.iterdir()) == []


def test_whether_it_is_held_can_be_seen(tmp_path):
    assert not is_locked(tmp_path)
    with SessionLock(tmp_path):
        assert is_locked(tmp_path)
        assert is_locked(tmp_path)
    assert not is_locked(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_killed_process_does_not_hold_it(tmp_path):
    code = (
        "import sys, time; from pathlib import Path;"
        "from sfm_front.storage.session_lock import SessionLock;"
        "lock = SessionLock(Path(sys.argv[1])); print('held', flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        assert is_locked(tmp_path)
        process.kill()
    assert (tmp_path / LOCK).exists()
    assert not is_locked(tmp_path)


def test_who_looks_is_not_in_the_way(tmp_path):
    (tmp_path / LOCK).touch()  # As a killed process leaves it.
    ended = Event()

    def look() -> None:
        while not ended.is_set():
            is_locked(tmp_path)

    watchers = [Thread(target=look) for _ in range(2)]
    for watcher in watchers:
        watcher.start()
    try:
        for _ in range(20):
            SessionLock(tmp_path).close()
            (tmp_path / LOCK).touch()
    finally:
        ended.set()
        for watcher in watchers:
            watcher.join()

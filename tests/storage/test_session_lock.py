"""One writer per folder, whatever the order in which processes come and go."""

from __future__ import annotations

import pytest

from sfm_front.errors import InputError
from sfm_front.storage.session_lock import OWNER, SessionLock


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

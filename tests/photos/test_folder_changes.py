"""Noticing that something changed below a folder."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from sfm_front.photos.folder_changes import FolderChanges

# Changes are noticed long before, also on a machine that is busy with something else.
DEADLINE_S = 20.0


@pytest.fixture(params=[False, True], ids=["events", "polling"])
def changes(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[FolderChanges]:
    (tmp_path / "sub").mkdir()
    (tmp_path / "out").mkdir()
    watching = FolderChanges(
        tmp_path,
        exclude=tmp_path / "out",
        polling=request.param,
        poll_s=0.05,
        note=pytest.fail,
    )
    yield watching
    watching.close()


def wait_for_one(changes: FolderChanges) -> bool:
    deadline = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline:
        if changes.wait():
            return True
    return False


def let_settle(changes: FolderChanges) -> None:
    """Until nothing more is heard of what was done before."""
    while any(changes.wait() for _ in range(10)):
        pass


def test_new_renamed_and_deleted_files_are_noticed(changes: FolderChanges, tmp_path: Path) -> None:
    file = tmp_path / "sub" / "a.jpg"
    (tmp_path / "sub" / "a.jpg.part").write_bytes(b"1")
    assert wait_for_one(changes)
    let_settle(changes)
    (tmp_path / "sub" / "a.jpg.part").rename(file)
    assert wait_for_one(changes)
    let_settle(changes)
    file.unlink()
    assert wait_for_one(changes)


def test_what_changes_in_the_excluded_folder_does_not_count(
    changes: FolderChanges, tmp_path: Path
) -> None:
    let_settle(changes)
    (tmp_path / "out" / "models").mkdir()
    for number in range(20):
        (tmp_path / "out" / f"{number}.jpg").write_bytes(b"1")
        assert not changes.wait()


def test_closed_it_notices_nothing_more(changes: FolderChanges, tmp_path: Path) -> None:
    changes.close()
    (tmp_path / "a.jpg").write_bytes(b"1")
    assert not any(changes.wait() for _ in range(10))

"""Nothing is removed or overwritten that a session did not write itself."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.locations import ROOT

from sfm_front.errors import InputError
from sfm_front.session.output_folder import (
    check_output_folder,
    open_output_folder,
    told_of_others,
)
from sfm_front.storage.atomic import write_atomically


def opened_and_closed(output: Path, *, overwrite: bool) -> None:
    open_output_folder(output, overwrite=overwrite).close()


def finished(folder: Path) -> Path:
    """An output as a session leaves it, with one model."""
    model = folder / "sparse" / "0"
    model.mkdir(parents=True)
    for name in ("cameras.bin", "images.bin", "points3D.bin", "points3D.ply"):
        (model / name).write_bytes(b"model")
    for name in ("session.json", "georeference.json"):
        (folder / "sparse" / name).write_bytes(b"of the models")
    for name in ("database.db", "retrieval.jsonl", "report.json", "report.html"):
        (folder / name).write_bytes(b"output")
    return folder


def contents(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


def put(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"precious")
    return path


def test_overwriting_removes_a_finished_output_and_nothing_beside_it(tmp_path):
    output = finished(tmp_path)
    kept = [put(output / name) for name in ("photo.jpg", "sparse woods/p.jpg", "sparse_mine/x")]
    opened_and_closed(output, overwrite=True)
    left = {path for path in output.rglob("*") if path.is_file()}
    assert left == {*kept, output / "retrieval.jsonl"}  # the marker of the session that follows


def test_what_else_lies_in_a_folder_is_told_and_stays(tmp_path):
    assert told_of_others(tmp_path / "new") == told_of_others(tmp_path) == ""
    (tmp_path / ".DS_Store").touch()
    assert told_of_others(tmp_path) == ""
    put(tmp_path / "images" / "a.jpg")
    assert told_of_others(tmp_path).startswith(f"{tmp_path}: is not empty; images will stay")
    for name in ("b.txt", "c.txt", "d.txt", "e.txt"):
        put(tmp_path / name)
    told = told_of_others(tmp_path)
    assert "b.txt, c.txt, d.txt and 2 more will stay" in told
    before = contents(tmp_path)
    opened_and_closed(tmp_path, overwrite=False)
    assert before.items() <= contents(tmp_path).items()
    assert told_of_others(tmp_path) == ""  # It is an output now.


def test_an_output_is_not_overwritten_unasked(tmp_path):
    output = finished(tmp_path)
    before = contents(output)
    with pytest.raises(InputError, match="holds a reconstruction already"):
        opened_and_closed(output, overwrite=False)
    assert contents(output) == before


@pytest.mark.parametrize(
    "foreign",
    ["sparse/0/photo.jpg", "sparse/by_hand/cameras.bin", "sparse/photo.jpg", "sparse.old/a/b"],
)
def test_overwriting_refuses_model_folders_that_hold_other_files(tmp_path, foreign):
    output = finished(tmp_path)
    put(output / foreign)
    before = contents(output)
    with pytest.raises(InputError, match="Move it away"):
        opened_and_closed(output, overwrite=True)
    assert contents(output) == before


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("theirs", ["sparse/0/cameras.bin", "database.db", "report.json"])
def test_a_project_of_another_tool_is_refused(tmp_path, theirs, overwrite):
    """COLMAP's own projects have database.db and sparse/0, too."""
    put(tmp_path / theirs)
    before = contents(tmp_path)
    with pytest.raises(InputError, match="did not write"):
        opened_and_closed(tmp_path, overwrite=overwrite)
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["retrieval.jsonl", "report.json", "database.db"])
@pytest.mark.parametrize("overwrite", [False, True])
def test_links_to_other_files_are_refused(tmp_path, name, overwrite):
    theirs = put(tmp_path / "theirs.txt")
    output = finished(tmp_path / "output")
    (output / name).unlink()
    (output / name).symlink_to(theirs)
    with pytest.raises(InputError):
        opened_and_closed(output, overwrite=overwrite)
    assert theirs.read_bytes() == b"precious"
    assert (output / name).is_symlink()


def test_a_linked_model_folder_is_refused(tmp_path):
    theirs = put(tmp_path / "theirs" / "0" / "cameras.bin")
    output = finished(tmp_path / "output")
    (output / "sparse.old").symlink_to(tmp_path / "theirs")
    with pytest.raises(InputError, match=r"sparse\.old"):
        opened_and_closed(output, overwrite=True)
    assert theirs.is_file()


def test_a_folder_where_a_file_belongs_is_refused(tmp_path):
    (tmp_path / "retrieval.jsonl").mkdir()
    with pytest.raises(InputError, match=r"retrieval\.jsonl"):
        opened_and_closed(tmp_path, overwrite=True)


def test_what_an_interrupted_removal_left_can_be_replaced(tmp_path):
    (finished(tmp_path) / "database.db").unlink()
    check_output_folder(tmp_path, overwrite=True)


def test_a_parent_that_is_a_file_is_named(tmp_path):
    below = put(tmp_path / "file") / "output"
    with pytest.raises(InputError, match="cannot be written to"):
        opened_and_closed(below, overwrite=False)


def test_a_second_writer_is_refused_and_named(tmp_path):
    output = finished(tmp_path)
    before = contents(output)
    with open_output_folder(output, overwrite=False, resume=True):
        held = contents(output)
        for overwrite in (False, True):
            with pytest.raises(InputError, match=f"process {os.getpid()} on .* is writing to it"):
                open_output_folder(output, overwrite=overwrite, resume=not overwrite)
        assert contents(output) == held
    assert contents(output) == before


def test_the_lock_of_a_killed_process_is_free(tmp_path):
    code = (
        "import os, sys; from pathlib import Path; "
        "from sfm_front.storage.session_lock import SessionLock; "
        "lock = SessionLock(Path(sys.argv[1])); os._exit(9)"
    )
    killed = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert killed.returncode == 9
    open_output_folder(finished(tmp_path), overwrite=False, resume=True).close()


@pytest.mark.parametrize("overwrite", [False, True])
def test_what_a_kill_left_half_written_is_no_stranger(tmp_path, monkeypatch, overwrite):
    """Neither a file of the folder nor what is beside the models."""
    output = finished(tmp_path)
    (output / "sparse.new").mkdir()

    class Killed(BaseException):
        pass

    def killed(_: object) -> None:
        raise Killed

    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", lambda *_, **__: None)
        for file in (output / "retrieval.jsonl", output / "sparse.new" / "session.json"):
            with pytest.raises(Killed):
                write_atomically(file, killed)
    left = [path for path in output.rglob(".*") if path.is_file()]
    assert len(left) == 2
    kept = put(output / ".retrieval.jsonl.kept")
    open_output_folder(output, overwrite=overwrite, resume=not overwrite).close()
    assert not any(path.exists() for path in left if path.parent == output)
    assert kept.exists()

"""events.jsonl: whole lines, and what happens where none can be written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import get_args

import pytest

from sfm_front.errors import StorageError
from sfm_front.events import Event, PhotoArrived
from sfm_front.reports import event_log
from sfm_front.reports.event_log import FILE, EventLog


def test_a_torn_line_of_a_killed_process_is_dropped(tmp_path):
    with EventLog.in_folder(tmp_path) as log:
        log.write(PhotoArrived("a.jpg"))
    with (tmp_path / FILE).open("a", encoding="utf-8") as file:
        file.write('{"v": 1, "time": "20')
    with EventLog.in_folder(tmp_path) as log:
        log.write(PhotoArrived("b.jpg"))
    lines = (tmp_path / FILE).read_text(encoding="utf-8").splitlines()
    assert [json.loads(line)["name"] for line in lines] == ["a.jpg", "b.jpg"]


def test_what_earlier_processes_acknowledged_is_known(tmp_path):
    with EventLog.in_folder(tmp_path) as log:
        assert not log.lacks(1)  # nobody could have written it before there was a file
        log.write(PhotoArrived("a.jpg"))
    with EventLog.in_folder(tmp_path) as log:
        assert log.lacks(1)
    with (tmp_path / FILE).open("a", encoding="utf-8") as file:
        file.write(json.dumps({"event": "photo_added", "image_id": 6}) + "\n")
        file.write(json.dumps({"event": "photo_arrived", "name": '"event": "photo_added"'}) + "\n")
        file.write('{"event": "photo_added", "image_id": 7')  # torn
    with EventLog.in_folder(tmp_path) as log:
        assert not log.lacks(6)
        assert log.lacks(7)


@pytest.mark.parametrize("kind", get_args(Event))
def test_each_event_is_in_the_schema(kind):
    name = event_log._NAMES[kind]
    assert f"``{name}``" in event_log.__doc__


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs Linux's always full device")
def test_a_full_disk_is_told():
    log = EventLog(Path("/dev/full").open("w", encoding="utf-8"))  # noqa: SIM115
    with pytest.raises(StorageError, match=r"events\.jsonl: .*No space left"):
        log.write(PhotoArrived("a.jpg"))
    log.close()

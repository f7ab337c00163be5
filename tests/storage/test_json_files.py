"""JSON files: what is written is what is read, and people can read it."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from sfm_front.storage.json_files import as_json, write_json


def test_what_is_written_is_what_is_read(tmp_path):
    file = tmp_path / "new" / "folder" / "a.json"
    content = {"name": "ä 1.jpg", "numbers": [0.1, None, True], "stray byte": os.fsdecode(b"\xff")}
    write_json(file, content)
    assert json.loads(file.read_text(encoding="utf-8")) == content


def test_letters_are_not_escaped(tmp_path):
    write_json(tmp_path / "a.json", ["ä"])
    assert (tmp_path / "a.json").read_bytes() == '[\n "ä"\n]\n'.encode()


def test_paths_are_text_and_anything_else_is_refused():
    assert json.loads(as_json({"cache": Path("a/b")})) == {"cache": "a/b"}
    with pytest.raises(TypeError):
        as_json({1.5j})

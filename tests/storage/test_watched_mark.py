"""Whether somebody looks at an output."""

from __future__ import annotations

import os
import time

from sfm_front.storage.watched_mark import WATCHED, is_watched, mark_watched, unmark_watched


def test_it_is_until_nobody_says_so_any_more(tmp_path):
    assert not is_watched(tmp_path)
    mark_watched(tmp_path)
    assert is_watched(tmp_path)
    old = time.time() - 60
    os.utime(tmp_path / WATCHED, (old, old))
    assert not is_watched(tmp_path)
    mark_watched(tmp_path)
    unmark_watched(tmp_path)
    assert not is_watched(tmp_path)
    unmark_watched(tmp_path)


def test_a_folder_that_is_not_there_is_not_watched(tmp_path):
    mark_watched(tmp_path / "gone")
    assert not is_watched(tmp_path / "gone")

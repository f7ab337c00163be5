"""Photos are copied one by one."""

from __future__ import annotations

import time
from threading import Event

from sfm_front.evaluation.live.camera import send_photos
from sfm_front.types import PhotoPath


def test_photos_are_copied_under_their_names_until_it_is_stopped(tmp_path):
    photos = []
    for name in ("a.jpg", "day 2/b.jpg"):
        path = tmp_path / "scene" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(name.encode())
        photos.append(PhotoPath(name, path))
    began = time.time()
    complete = send_photos(photos, tmp_path / "watched", 0.01, Event())
    assert list(complete) == ["a.jpg", "day 2/b.jpg"]
    assert began <= complete["a.jpg"] <= complete["day 2/b.jpg"] <= time.time()
    assert (tmp_path / "watched" / "day 2" / "b.jpg").read_bytes() == b"day 2/b.jpg"
    stopped = Event()
    stopped.set()
    assert send_photos(photos, tmp_path / "empty", 0.01, stopped) == {}
    assert not (tmp_path / "empty").exists()

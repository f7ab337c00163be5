"""Photos as they appear in a folder: real files, written while they are watched."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from helpers.photo_files import photo

from sfm_front.errors import ConfigError, InputError
from sfm_front.photos import folder_changes, watch
from sfm_front.photos.source import find_photos, list_photos
from sfm_front.photos.watch import WatchOptions, watch_photos
from sfm_front.runtime.prefetch import prefetch
from sfm_front.types import NotYet, PhotoPath

# What must happen, happens long before, also on a machine that is busy with something else.
DEADLINE_S = 20.0

# Longer than a whole file rests before it is taken.
REST_S = 0.05
WELL_RESTED_S = 5 * REST_S

Watching = Generator[PhotoPath | NotYet, None, None]


@cache
def content(seed: int = 0, kind: str = "JPEG") -> bytes:
    buffer = BytesIO()
    photo(seed, 0).save(buffer, kind)
    return buffer.getvalue()


def write(path: Path, data: bytes | None = None) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content() if data is None else data)


class Watch:
    """A folder being watched, what was taken from it and what was said."""

    def __init__(self, folder: Path, **given: Any) -> None:
        keywords = {key: given.pop(key) for key in ("exclude", "stop") if key in given}
        options = WatchOptions(**{"rest_s": REST_S, **given})
        self.taken: list[str] = []
        self.notes: list[str] = []
        self.items = watch_photos(folder, options, note=self.notes.append, **keywords)

    def until(self, condition: Callable[[], bool]) -> None:
        """Take what comes until ``condition`` holds."""
        deadline = time.monotonic() + DEADLINE_S
        for item in self.items:
            if isinstance(item, PhotoPath):
                self.taken.append(item.name)
            if condition():
                return
            assert time.monotonic() < deadline, (self.taken, self.notes)
        raise AssertionError(f"it ended: {self.taken}, {self.notes}")

    def take(self, *names: str) -> None:
        """Take photos until there are as many as ``names``; they must be these, in this order."""
        self.taken.clear()
        self.until(lambda: len(self.taken) >= len(names))
        assert self.taken == list(names)

    def take_none(self, seconds: float = WELL_RESTED_S) -> None:
        """Nothing may come for so long."""
        self.taken.clear()
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end)
        assert self.taken == []

    def begin(self) -> None:
        """Until it watches; the folder must have no photo."""
        assert isinstance(next(self.items), NotYet)


@pytest.fixture
def watching() -> Iterator[Callable[..., Watch]]:
    opened: list[Watch] = []

    def begin(folder: Path, **given: Any) -> Watch:
        opened.append(Watch(folder, **given))
        return opened[-1]

    yield begin
    for each in opened:
        each.items.close()


@contextmanager
def meanwhile(function: Callable[[], None]) -> Iterator[None]:
    """Run ``function`` in a thread; an error in it is one of the test."""
    errors: list[BaseException] = []

    def run() -> None:
        try:
            function()
        except BaseException as error:
            errors.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    yield
    thread.join(DEADLINE_S)
    assert not thread.is_alive()
    assert not errors


Begin = Callable[..., Watch]


def test_photos_that_are_there_come_as_they_are_listed(tmp_path: Path, watching: Begin) -> None:
    names = ("b.jpg", "a.JPG", "img10.jpg", "img2.jpg", "sub/c.jpg", "sub/.d.jpg", ".trash/e.jpg")
    for name in (*names, "notes.txt"):
        write(tmp_path / name)
    write(tmp_path / "z.png", content(kind="PNG"))
    listed = list_photos(tmp_path)
    photos = (item for item in watching(tmp_path).items if isinstance(item, PhotoPath))
    assert len(listed) == 6
    assert [next(photos) for _ in listed] == listed


def test_photos_that_appear_follow_each_once(tmp_path: Path, watching: Begin) -> None:
    write(tmp_path / "b.jpg")
    watched = watching(tmp_path)
    watched.take("b.jpg")
    for name in ("c.jpg", "a.jpg"):
        with meanwhile(lambda name=name: write(tmp_path / name)):
            watched.take(name)
    write(tmp_path / "b.jpg", content(seed=1))
    (tmp_path / "a.jpg").unlink()
    watched.take_none()
    write(tmp_path / "a.jpg")
    watched.take_none()
    assert watched.notes == ["b.jpg: has changed since it was taken in; the old one stays"]


def test_a_photo_copied_slowly_is_taken_when_whole(tmp_path: Path, watching: Begin) -> None:
    data = content()
    watched = watching(tmp_path)
    watched.begin()
    let_go = threading.Event()

    def copy_slowly() -> None:
        with (tmp_path / "a.jpg").open("wb", buffering=0) as file:
            for at in range(0, 4000, 1000):
                file.write(data[at : at + 1000])
                time.sleep(0.02)
            assert let_go.wait(DEADLINE_S)
            file.write(data[4000:])

    with meanwhile(copy_slowly):
        watched.take_none()  # The copy stalls for longer than a whole file has to rest.
        write(tmp_path / "b.jpg")
        watched.take("b.jpg")
        let_go.set()
        watched.take("a.jpg")


def test_a_whole_file_that_still_changes_is_left_to_rest(tmp_path: Path, watching: Begin) -> None:
    """As one that more is appended to: films, further images."""
    watched = watching(tmp_path, rest_s=60)
    write(tmp_path / "a.jpg")
    watched.take_none()


@pytest.mark.parametrize("under_way", ["a.jpg.part", "a.jpg.crdownload", ".a.jpg", "a.jpg~", "tmp"])
def test_a_name_of_files_under_way_is_left_until_renamed(
    tmp_path: Path, watching: Begin, under_way: str
) -> None:
    watched = watching(tmp_path)
    watched.begin()
    write(tmp_path / under_way)
    watched.take_none()
    with meanwhile(lambda: (tmp_path / under_way).rename(tmp_path / "a.jpg") and None):
        watched.take("a.jpg")
    assert watched.notes == []


def test_a_photo_deleted_while_it_waits_is_forgotten(tmp_path: Path, watching: Begin) -> None:
    write(tmp_path / "a.jpg", content()[:-100])
    watched = watching(tmp_path)
    watched.take_none()
    (tmp_path / "a.jpg").unlink()
    watched.until(lambda: bool(watched.notes))
    assert watched.notes == ["a.jpg: deleted before it was taken"]
    write(tmp_path / "a.jpg")
    watched.take("a.jpg")


@pytest.mark.parametrize("by_renaming", [True, False])
def test_a_photo_replaced_while_it_waits_is_taken_once(
    tmp_path: Path, watching: Begin, by_renaming: bool
) -> None:
    write(tmp_path / "a.jpg", content()[:-100])
    watched = watching(tmp_path)
    watched.take_none()
    if by_renaming:
        write(tmp_path / "new", content())
        (tmp_path / "new").replace(tmp_path / "a.jpg")
    else:
        write(tmp_path / "a.jpg", b"")
        watched.until(lambda: bool(watched.notes))
        write(tmp_path / "a.jpg")
    watched.take("a.jpg")
    watched.take_none()
    assert watched.notes == ["a.jpg: replaced before it was taken"]


def test_a_photo_that_changes_after_it_was_taken_is_told_once(
    tmp_path: Path, watching: Begin
) -> None:
    """As when a second card with the same names comes into the folder."""
    write(tmp_path / "a.jpg")
    watched = watching(tmp_path)
    watched.take("a.jpg")
    write(tmp_path / "a.jpg", content() + b"more")
    watched.until(lambda: bool(watched.notes))
    watched.take_none()
    assert watched.notes == ["a.jpg: has changed since it was taken in; the old one stays"]


def test_a_file_that_never_becomes_whole_is_handed_on(tmp_path: Path, watching: Begin) -> None:
    """For the reader to say what is wrong with it; those after it do not wait for it."""
    write(tmp_path / "a.jpg", content()[:-100])
    write(tmp_path / "b.jpg", b"no image")
    write(tmp_path / "c.jpg")
    watching(tmp_path, patience_s=1.0).take("c.jpg", "a.jpg", "b.jpg")


def test_a_file_that_was_handed_on_cut_short_comes_again_once_it_is_whole(
    tmp_path: Path, watching: Begin
) -> None:
    """A copy may stall for longer than patience lasts, and go on."""
    write(tmp_path / "a.jpg", content()[:-100])
    write(tmp_path / "b.jpg")
    watched = watching(tmp_path, patience_s=0.2)
    watched.take("b.jpg", "a.jpg")
    watched.take_none()
    write(tmp_path / "a.jpg")
    watched.take("a.jpg")
    # Whole now: what becomes of it after that is nobody's business.
    write(tmp_path / "a.jpg", content(1))
    watched.take_none()


@pytest.mark.skipif(sys.platform == "win32", reason="links need a right there")
def test_a_link_to_nowhere_is_handed_on(tmp_path: Path, watching: Begin) -> None:
    (tmp_path / "a.jpg").symlink_to(tmp_path / "nowhere.jpg")
    watched = watching(tmp_path, patience_s=0.2)
    watched.take("a.jpg")
    assert watched.notes == []


def test_sub_folders_that_appear_are_watched(tmp_path: Path, watching: Begin) -> None:
    watched = watching(tmp_path)
    watched.begin()
    with meanwhile(lambda: write(tmp_path / "day 2" / "card" / "a.jpg")):
        watched.take("day 2/card/a.jpg")
    write(tmp_path / "day 2" / "b.jpg")
    watched.take("day 2/b.jpg")
    write(tmp_path.parent / f"{tmp_path.name} elsewhere" / "c.jpg")
    (tmp_path.parent / f"{tmp_path.name} elsewhere").rename(tmp_path / "day 3")
    watched.take("day 3/c.jpg")


def test_nothing_is_taken_from_the_output_folder(tmp_path: Path, watching: Begin) -> None:
    output = tmp_path / "out"
    watched = watching(tmp_path, exclude=output)
    watched.begin()
    write(output / "thumbnails" / "a.jpg")
    write(tmp_path / "outer" / "b.jpg")
    watched.take("outer/b.jpg")
    write(output / "c.jpg")
    watched.take_none()


def test_a_folder_is_waited_for_and_may_vanish_and_come_back(
    tmp_path: Path, watching: Begin
) -> None:
    folder = tmp_path / "card" / "DCIM"
    watched = watching(folder)
    watched.take_none()
    assert watched.notes == [f"{folder}: waiting for it"]
    with meanwhile(lambda: write(folder / "a.jpg")):
        watched.take("a.jpg")
    write(folder / "b.jpg", b"under way")
    watched.take_none()
    (tmp_path / "card").rename(tmp_path / "removed")
    watched.until(lambda: "gone" in watched.notes[-1])
    write(folder / "a.jpg")
    write(folder / "b.jpg")
    watched.take("b.jpg")
    write(folder / "c.jpg")
    watched.take("c.jpg")
    # Nothing of b.jpg, which was under way.
    assert watched.notes == [
        f"{folder}: waiting for it",
        f"{folder}: there now",
        f"{folder}: gone, waiting for it to come back",
        f"{folder}: there now",
    ]


def test_another_folder_in_its_place_is_watched(tmp_path: Path, watching: Begin) -> None:
    folder = tmp_path / "card"
    write(folder / "a.jpg")
    write(tmp_path / "other" / "b.jpg")
    watched = watching(folder, rescan_s=60)
    watched.take("a.jpg")
    folder.rename(tmp_path / "old")
    (tmp_path / "other").rename(folder)
    watched.take("b.jpg")
    assert watched.notes == [f"{folder}: another folder took its place"]
    write(folder / "c.jpg")
    watched.take("c.jpg")


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    write(tmp_path / "a.jpg")
    with pytest.raises(InputError, match="not a folder"):
        next(watch_photos(tmp_path / "a.jpg"))


def test_it_ends_when_nothing_has_come_for_long(tmp_path: Path) -> None:
    write(tmp_path / "a.jpg")
    write(tmp_path / "b.jpg", b"no image")
    options = WatchOptions(rest_s=REST_S, patience_s=0.6, idle_timeout_s=0.3)
    seconds = []
    taken = []
    for item in watch_photos(tmp_path, options):
        if isinstance(item, NotYet):
            seconds.append(item.seconds)
        else:
            taken.append(item.name)
            seconds.clear()
    assert taken == ["a.jpg", "b.jpg"]  # The second one waited for longer than the timeout.
    assert seconds == sorted(seconds)


def test_the_timeout_does_not_run_while_photos_are_worked_on(tmp_path: Path) -> None:
    """They are under way for longer than it; then another one comes."""
    write(tmp_path / "a.jpg")
    options = WatchOptions(rest_s=REST_S, idle_timeout_s=0.1)
    idle_s = [0.0]
    taken, quiet_s = [], 0.0
    for item in watch_photos(tmp_path, options, idle_s=lambda: idle_s[0]):
        if isinstance(item, PhotoPath):
            taken.append(item.name)
            idle_s[0] = math.inf if len(taken) == 2 else 0.0
        elif len(taken) == 1:
            if quiet_s < 0.3 <= item.seconds:
                write(tmp_path / "b.jpg")
            quiet_s = max(quiet_s, item.seconds)
    assert taken == ["a.jpg", "b.jpg"]
    assert quiet_s >= 0.3


def test_the_folder_is_listed_once_more_before_the_timeout(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch, "_SETTLING_S", 0.0)
    write(tmp_path / "a.jpg")
    options = WatchOptions(rest_s=REST_S, idle_timeout_s=0.3, polling=True, poll_s=60, rescan_s=60)
    taken = []
    for item in watch_photos(tmp_path, options):
        if isinstance(item, PhotoPath):
            taken.append(item.name)
            if item.name == "a.jpg":
                write(tmp_path / "b.jpg")
                time.sleep(0.4)  # Busy with the first one.
    assert taken == ["a.jpg", "b.jpg"]


def test_it_is_stopped_from_another_thread(tmp_path: Path) -> None:
    write(tmp_path / "a.jpg")
    stop, is_taken = threading.Event(), threading.Event()

    def stop_after_the_first() -> None:
        assert is_taken.wait(DEADLINE_S)
        stop.set()

    taken = []
    with meanwhile(stop_after_the_first):
        for item in watch_photos(tmp_path, stop=stop.is_set):
            if isinstance(item, PhotoPath):
                taken.append(item.name)
                is_taken.set()
    assert taken == ["a.jpg"]


def test_stopped_it_leaves_what_is_waiting(tmp_path: Path) -> None:
    write(tmp_path / "a.jpg")
    assert list(watch_photos(tmp_path, stop=lambda: True)) == []


@pytest.mark.parametrize("polling", [False, True])
def test_events_or_polling_suffice(
    tmp_path: Path, watching: Begin, monkeypatch: pytest.MonkeyPatch, polling: bool
) -> None:
    monkeypatch.setattr(watch, "_SETTLING_S", 0.0)
    (tmp_path / "sub").mkdir()
    watched = watching(tmp_path, polling=polling, poll_s=0.05, rescan_s=60)
    watched.take_none()
    write(tmp_path / "sub" / "a.jpg")
    watched.take("sub/a.jpg")
    assert watched.notes == []


@pytest.mark.parametrize("after", ["the start", "an event"])
def test_it_is_listed_repeatedly_for_a_while(
    tmp_path: Path, watching: Begin, monkeypatch: pytest.MonkeyPatch, after: str
) -> None:
    """What comes into a folder that is new may come before its events are asked for."""
    events: list[str] = []

    def watch_system(*_: Any, **__: Any) -> Iterator[Any]:
        while True:
            time.sleep(0.001)
            yield {events.pop()} if events else set()

    monkeypatch.setattr(folder_changes, "watch", watch_system)
    monkeypatch.setattr(watch, "_SETTLING_S", 60.0 if after == "the start" else 0.0)
    watched = watching(tmp_path, rescan_s=60)
    watched.begin()
    if after == "an event":
        monkeypatch.setattr(watch, "_SETTLING_S", 60.0)
        events.append("one of something else")
        watched.until(lambda: not events)
    watched.take_none()
    write(tmp_path / "a.jpg")
    watched.take("a.jpg")
    assert watched.notes == []


class NoEvents:
    """Stands for watchfiles where the system sends none; polling works."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, error: Exception | None = None) -> None:
        self.polled: list[bool] = []
        self._watch, self._error = folder_changes.watch, error
        monkeypatch.setattr(folder_changes, "watch", self)

    def __call__(self, *paths: Path, **options: Any) -> Iterator[Any]:
        self.polled.append(bool(options["force_polling"]))
        if options["force_polling"]:
            yield from self._watch(*paths, **options)
        elif self._error is not None:
            raise self._error
        while True:
            time.sleep(0.001)
            yield set()


def test_a_photo_that_no_event_announced_starts_polling(
    tmp_path: Path, watching: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = NoEvents(monkeypatch)
    monkeypatch.setattr(watch, "_SETTLING_S", 0.0)
    watched = watching(tmp_path, rescan_s=0.2, poll_s=0.05)
    watched.begin()
    write(tmp_path / "a.jpg")
    watched.take("a.jpg")
    assert system.polled == [False, True]
    assert watched.notes == [f"{tmp_path}: photos appear without an event, polling instead"]
    write(tmp_path / "b.jpg")
    watched.take("b.jpg")


def test_what_cannot_be_watched_is_polled(
    tmp_path: Path, watching: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = NoEvents(monkeypatch, OSError("too many watches"))
    watched = watching(tmp_path, rescan_s=60, poll_s=0.05)
    watched.begin()
    assert system.polled == [False, True]
    assert "polling instead: too many watches" in watched.notes[0]
    write(tmp_path / "a.jpg")
    watched.take("a.jpg")


def test_what_cannot_even_be_polled_is_listed(
    tmp_path: Path, watching: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> Iterator[Any]:
        raise RuntimeError("no threads")
        yield

    monkeypatch.setattr(folder_changes, "watch", fail)
    watched = watching(tmp_path, rescan_s=0.2)
    watched.begin()
    write(tmp_path / "a.jpg")
    watched.take("a.jpg")
    assert ["polling instead" in line for line in watched.notes] == [True, False]


def test_a_folder_that_cannot_be_listed_is_named_once(
    tmp_path: Path, watching: Begin, monkeypatch: pytest.MonkeyPatch
) -> None:
    listings = 0

    def find(folder: Path, *, on_error: Callable[[OSError], None], **rest: Any) -> list[PhotoPath]:
        nonlocal listings
        listings += 1
        on_error(PermissionError(13, "Permission denied", "closed"))
        on_error(FileNotFoundError(2, "No such file or directory", "gone meanwhile"))
        return find_photos(folder, on_error=on_error, **rest)

    monkeypatch.setattr(watch, "find_photos", find)
    write(tmp_path / "a.jpg")
    watched = watching(tmp_path, rescan_s=0.05)
    watched.take("a.jpg")
    watched.until(lambda: listings > 2)
    assert watched.notes == ["closed: cannot be listed: Permission denied"]


def test_read_ahead_each_photo_is_handed_on_before_the_next_appears(tmp_path: Path) -> None:
    """A photo is written only when the one before it has come out."""
    write(tmp_path / "0.jpg")
    results: list[str] = []
    options = WatchOptions(rest_s=REST_S, idle_timeout_s=DEADLINE_S)
    photos = watch_photos(tmp_path, options, stop=lambda: len(results) == 4)
    with closing(prefetch(lambda photo: photo.name, photos, num_threads=2)) as stream:
        for result in stream:
            if not isinstance(result, NotYet):
                results.append(result)
                if len(results) < 4:
                    write(tmp_path / f"{len(results)}.jpg")
    assert results == ["0.jpg", "1.jpg", "2.jpg", "3.jpg"]


@pytest.mark.parametrize(
    ("option", "value"),
    [("rest_s", -1.0), ("patience_s", float("nan")), ("rescan_s", 0.0), ("poll_s", -0.1)],
)
def test_times_that_cannot_be_are_refused(option: str, value: float) -> None:
    with pytest.raises(ConfigError, match=option):
        WatchOptions(**{option: value})
    with pytest.raises(ConfigError, match="idle_timeout_s"):
        WatchOptions(idle_timeout_s=-1.0)

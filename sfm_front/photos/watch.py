"""A folder -> the photos in it and those that appear, each once and when it is whole."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from pathlib import Path

from sfm_front.errors import ConfigError, InputError
from sfm_front.photos.folder_changes import TICK_S, FolderChanges
from sfm_front.photos.source import find_photos, folder_identity
from sfm_front.photos.wholeness import is_whole
from sfm_front.types import NotYet, PhotoPath

# A folder that is new may be filled before its events are asked for: so long after each event, in
# seconds, the photos are listed again.
_SETTLING_S = 0.5

# Listing a folder of very many photos, or one on a slow share, takes at most this part of the time.
_LISTING_SHARE = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class WatchOptions:
    """When a photo is whole, how it is noticed, and when to stop. All times in seconds."""

    # A photo is taken if size and time of change of its file have rested for this time...
    rest_s: float = 0.2
    # ... and its image has an end; or, for the reader to say what is wrong with it, after this.
    patience_s: float = 10.0
    # The folder is listed this often, whatever the system says or does not say of changes.
    rescan_s: float = 2.0
    # Do not even try events. Else polling begins where there are none, as on network shares.
    polling: bool = False
    # How often polling looks.
    poll_s: float = 0.3
    # The end, if nothing new has come for this time and nothing is waiting. None: never.
    idle_timeout_s: float | None = None

    def __post_init__(self) -> None:
        for name in ("rest_s", "patience_s"):
            if not getattr(self, name) >= 0:
                raise ConfigError(f"{name} must be at least 0, got {getattr(self, name)}")
        for name in ("rescan_s", "poll_s"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be above 0, got {getattr(self, name)}")
        if self.idle_timeout_s is not None and not self.idle_timeout_s >= 0:
            raise ConfigError(f"idle_timeout_s must be at least 0, got {self.idle_timeout_s}")


def check_watchable(folder: Path) -> None:
    """Raises InputError if something else than a folder is there; it may be missing."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: not a folder. Give the folder where the photos appear.")


def watch_photos(
    folder: Path,
    options: WatchOptions | None = None,
    *,
    exclude: Path | None = None,
    stop: Callable[[], bool] = lambda: False,
    idle_s: Callable[[], float] = lambda: math.inf,
    note: Callable[[str], None] = lambda _: None,
) -> Generator[PhotoPath | NotYet, None, None]:
    """The photos that are there, in the order of ``list_photos``, then those that appear.

    Photos are those of ``list_photos``, with the same names. They are known by their extension, so
    ``a.jpg.part`` or ``a.jpg~`` is left alone until it is renamed. A file under way does not hold
    up those after it. No name comes twice, except of a file that was not whole when patience ended
    and has changed since.

    Whenever no photo is ready, ``NotYet`` comes, some 30 times a second: so whoever takes the
    photos can do other work meanwhile; its ``seconds`` count from the last photo that appeared,
    changed or was taken. What takes longer is no harm: changes are noticed meanwhile.

    It ends once ``stop`` says so (``threading.Event().is_set`` will do), or after
    ``options.idle_timeout_s``, and may be closed at any time. That time does not run while whoever
    takes the photos is busy with them: ``idle_s`` tells for how many seconds it has not been.
    ``folder`` may be missing at the start, or vanish and come back: it is waited for. ``note``
    hears of that, and of photos that were deleted or replaced before they were taken, in one line
    each. Raises InputError as ``check_watchable`` does.

    Everything here runs in the thread that asks for the next item, ``stop`` and ``note`` too.
    """
    check_watchable(folder)
    watched = _WatchedFolder(folder, options or WatchOptions(), exclude, note)
    try:
        while not stop():
            photo = watched.take()
            if photo is None:
                watched.look()
                photo = watched.take()
            if photo is not None:
                yield photo
            elif watched.is_over(idle_s()):
                return
            else:
                yield NotYet(watched.quiet_s)
    finally:
        watched.close()


@dataclass(frozen=True, slots=True)
class _FileState:
    """What changes while a file is written; ``inode`` differs if another file took its place."""

    size: int
    modified_ns: int
    inode: int = field(compare=False)


@dataclass(slots=True)
class _Waiting:
    """A photo that is not taken yet, and since when its file has rested in this state."""

    photo: PhotoPath
    state: _FileState
    since: float
    # Its end was looked for in this state, and is not there.
    is_cut_short: bool = False


@dataclass(slots=True)
class _Taken:
    """A photo that was taken, in which state, and whether it was whole then."""

    state: _FileState
    was_whole: bool
    change_told: bool = False


class _WatchedFolder:
    """The photos of a folder that were not taken yet."""

    def __init__(
        self,
        folder: Path,
        options: WatchOptions,
        exclude: Path | None,
        note: Callable[[str], None],
    ) -> None:
        self._folder = folder
        self._options = options
        self._exclude = exclude
        self._note = note
        # None while the folder is not there.
        self._changes: FolderChanges | None = None
        self._identity: tuple[int, int] | None = None
        self._was_missed = False
        self._was_there = False
        # By name, in the order they were found.
        self._waiting: dict[str, _Waiting] = {}
        self._taken: dict[str, _Taken] = {}
        self._unlistable: set[str] = set()
        # All by the monotonic clock.
        self._last_news = time.monotonic()
        self._next_listing = 0.0
        self._no_listing_before = 0.0
        self._settled_at = 0.0

    @property
    def quiet_s(self) -> float:
        """Seconds since a photo appeared, changed or was taken."""
        return time.monotonic() - self._last_news

    def is_over(self, idle_s: float) -> bool:
        """Whether nothing is waiting, nothing has come, and nobody had anything to do, for as long
        as the options allow."""
        timeout_s = self._options.idle_timeout_s
        if timeout_s is None or self._waiting or min(self.quiet_s, idle_s) < timeout_s:
            return False
        # Whoever takes the photos may have been busy with something else all this time.
        return self._changes is None or not self._list()

    def take(self) -> PhotoPath | None:
        """The first waiting photo that is whole, or whose patience is at an end."""
        for waiting in list(self._waiting.values()):
            name, path = waiting.photo.name, waiting.photo.path
            state = _state_of(path)
            now = time.monotonic()
            if state is None:
                if folder_identity(self._folder) != self._identity:
                    return None  # All of them are gone, which is said once.
                del self._waiting[name]
                self._note(f"{name}: deleted before it was taken")
            elif state != waiting.state:
                if state.inode != waiting.state.inode or state.size < waiting.state.size:
                    self._note(f"{name}: replaced before it was taken")
                self._waiting[name] = _Waiting(waiting.photo, state, now)
                self._last_news = now
            elif self._is_ready(waiting, now - waiting.since):
                del self._waiting[name]
                self._taken[name] = _Taken(state, was_whole=not waiting.is_cut_short)
                self._last_news = now
                return waiting.photo
        return None

    def _is_ready(self, waiting: _Waiting, rested_s: float) -> bool:
        if rested_s < self._options.rest_s:
            return False
        if not waiting.is_cut_short:
            waiting.is_cut_short = not is_whole(waiting.photo.path)
        return not waiting.is_cut_short or rested_s >= self._options.patience_s

    def look(self) -> None:
        """Wait a moment for changes, and find new photos after any, or if it is time to."""
        identity = folder_identity(self._folder) if self._folder.is_dir() else None
        if identity is None:
            self._miss()
        elif self._changes is None or identity != self._identity:
            self._open(identity)
        else:
            self._follow(self._changes)

    def _miss(self) -> None:
        if not self._was_missed:
            self._was_missed = True
            self._forget()
            state = "gone, waiting for it to come back" if self._was_there else "waiting for it"
            self._note(f"{self._folder}: {state}")
        time.sleep(TICK_S)

    def _open(self, identity: tuple[int, int]) -> None:
        if self._was_missed:
            self._note(f"{self._folder}: there now")
        elif self._was_there:
            self._note(f"{self._folder}: another folder took its place")
        self._forget()
        self._was_missed, self._was_there = False, True
        self._identity = identity
        # Before the first listing, so that nothing falls between the two.
        self._changes = FolderChanges(
            self._folder,
            exclude=self._exclude,
            polling=self._options.polling,
            poll_s=self._options.poll_s,
            note=self._note,
        )
        self._list()
        self._settled_at = time.monotonic() + _SETTLING_S

    def _forget(self) -> None:
        self.close()
        self._waiting.clear()

    def _follow(self, changes: FolderChanges) -> None:
        was_settled = time.monotonic() >= self._settled_at
        changed = changes.wait()
        now = time.monotonic()
        if changed:
            self._settled_at = now + _SETTLING_S
            self._next_listing = now
        if now < self._no_listing_before or (was_settled and now < self._next_listing):
            return
        found = self._list()
        if found and was_settled and not changed and not changes.polls and not changes.wait():
            self._note(f"{self._folder}: photos appear without an event, polling instead")
            changes.poll()

    def _list(self) -> bool:
        """Whether there are photos that were not there before."""
        began = time.monotonic()
        found = find_photos(self._folder, exclude=self._exclude, on_error=self._cannot_be_listed)
        num_before = len(self._waiting)
        for photo in found:
            if photo.name in self._waiting:
                continue
            state, taken = _state_of(photo.path), self._taken.get(photo.name)
            if state is None or (taken is not None and state == taken.state):
                continue
            if taken is not None and taken.was_whole:
                # The same bytes may have been copied once more.
                if state.size != taken.state.size and not taken.change_told:
                    taken.change_told = True
                    self._note(
                        f"{photo.name}: has changed since it was taken in; the old one stays"
                    )
                continue
            self._last_news = time.monotonic()
            self._waiting[photo.name] = _Waiting(photo, state, self._last_news)
        now = time.monotonic()
        self._no_listing_before = now + (now - began) * (1 / _LISTING_SHARE - 1)
        self._next_listing = now + self._options.rescan_s
        return len(self._waiting) > num_before

    def _cannot_be_listed(self, error: OSError) -> None:
        # What has just vanished is no news, and the rest would be said at each listing.
        if not isinstance(error, FileNotFoundError) and error.filename not in self._unlistable:
            self._unlistable.add(error.filename)
            self._note(f"{error.filename}: cannot be listed: {error.strerror}")

    def close(self) -> None:
        if self._changes is not None:
            self._changes.close()
            self._changes = None


def _state_of(path: Path) -> _FileState | None:
    """None if there is no such file. A link to nowhere is one: it is for the reader to report."""
    try:
        status = path.stat()
    except OSError:
        try:
            status = path.lstat()
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError:
            return _FileState(size=0, modified_ns=0, inode=0)
    return _FileState(status.st_size, status.st_mtime_ns, status.st_ino)

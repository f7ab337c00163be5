"""The extracted photos of a folder on disk, kept up to date with the folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from sfm_front.errors import InputError
from sfm_front.features.cached_extraction import CachedExtraction, CachedPhoto
from sfm_front.features.feature_cache import CacheKeys
from sfm_front.photos.cameras import CameraCatalog, CameraOptions
from sfm_front.storage.json_files import write_json
from sfm_front.types import ExtractedPhoto, Float32Array, PhotoPath, Skipped, SkipReason, View

_FORMAT = 1
_FILE = "index.json"


@dataclass(frozen=True, slots=True)
class _Entry:
    """A file when it was extracted; the same path, size and time mean an unchanged file."""

    path: str
    size: int
    mtime_ns: int
    digest: str = ""
    skipped: tuple[str, str] | None = None

    def same_file(self, other: _Entry) -> bool:
        return (self.path, self.size, self.mtime_ns) == (other.path, other.size, other.mtime_ns)


@dataclass(frozen=True, slots=True)
class Update:
    """What an update of the index did: numbers of photos.

    ``kept`` are unchanged, ``described`` new or changed, ``removed`` gone, ``skipped`` unusable.
    ``discarded`` says why the old index was not used; empty if it was, or there was none.
    """

    kept: int
    described: int
    removed: int
    skipped: tuple[Skipped, ...]
    discarded: str = ""

    def __str__(self) -> str:
        told = f"index: {self.kept} photos unchanged, {self.described} described"
        if self.removed:
            told += f", {self.removed} gone"
        if self.skipped:
            told += f", {len(self.skipped)} skipped"
        return f"index rebuilt: {self.discarded}; {told}" if self.discarded else told


class PhotoIndex(Mapping[int, View]):
    """The photos of a folder by image id, counted from 1 in order of name.

    Views are read from disk on access: a query needs few of them.
    """

    def __init__(self, folder: Path, describer: CachedExtraction) -> None:
        """``folder`` holds the index, or will; ``describer`` keeps its files there too."""
        self._file = folder / _FILE
        self._describer = describer
        self.photos: dict[int, PhotoPath] = {}
        self._digests: dict[int, str] = {}

    def update(
        self,
        photos: Sequence[PhotoPath],
        *,
        num_threads: int,
        progress: Callable[[int, int], None] | None = None,
    ) -> Update:
        """Extract new and changed photos, forget missing ones, and write the index.

        ``progress`` is told how many photos are described, and of how many, after each. Raises
        InputError where the index cannot be written.
        """
        old, discarded = self._load()
        now = {photo.name: _entry(photo) for photo in photos}
        missing = []
        for photo in photos:
            before = old.get(photo.name)
            if before and before.same_file(now[photo.name]) and self._is_complete(before):
                now[photo.name] = before
            else:
                missing.append(photo)
        num_described = 0
        described = self._describer.stream(missing, num_threads=num_threads)
        for done, (photo, result) in enumerate(zip(missing, described, strict=True), 1):
            now[photo.name] = _completed(now[photo.name], result)
            num_described += isinstance(result, CachedPhoto)
            if progress is not None:
                progress(done, len(missing))
        self._save(now)
        self.photos = dict(enumerate((p for p in photos if not now[p.name].skipped), 1))
        self._digests = {i: now[photo.name].digest for i, photo in self.photos.items()}
        self._describer.files.keep_only(map(self._keys, self._digests.values()))
        return Update(
            kept=sum(not now[p.name].skipped for p in photos) - num_described,
            described=num_described,
            removed=len(old.keys() - now.keys()),
            skipped=tuple(
                Skipped(name, SkipReason(entry.skipped[0]), entry.skipped[1])
                for name, entry in now.items()
                if entry.skipped
            ),
            discarded=discarded,
        )

    def vector(self, image_id: int) -> Float32Array:
        """The photo's global vector."""
        vectors = self._describer.files.load_vectors(self._keys(self._digests[image_id]))
        return vectors[0] if vectors else self.described(image_id).photo.global_vector

    def described(self, image_id: int) -> CachedPhoto:
        """The photo with its features and global vector.

        Raises InputError if the file has become unusable since ``update``.
        """
        photo = self.photos[image_id]
        described = self._describer.describe(photo, digest=self._digests[image_id])
        if isinstance(described, Skipped):
            raise InputError(f"{photo.path}: {described}. It has just changed: run again.")
        return described

    def __getitem__(self, image_id: int) -> View:
        return view_of(image_id, self.described(image_id).photo)

    def __iter__(self) -> Iterator[int]:
        return iter(self.photos)

    def __len__(self) -> int:
        return len(self.photos)

    def _keys(self, digest: str) -> CacheKeys:
        return self._describer.settings.keys(digest)

    def _is_complete(self, entry: _Entry) -> bool:
        if entry.skipped:
            # An unreadable file may have become readable without changing.
            return entry.skipped[0] != SkipReason.UNREADABLE.value
        return self._describer.files.has(self._keys(entry.digest))

    def _load(self) -> tuple[dict[str, _Entry], str]:
        """Entries of the index on disk; or none, and why they cannot be used."""
        try:
            content = json.loads(self._file.read_text(encoding="utf-8"))
            if content["format"] != _FORMAT or content["settings"] != self._settings():
                return {}, "it was made with other settings or another global descriptor"
            entries = {name: _Entry(**entry) for name, entry in content["photos"].items()}
            for entry in entries.values():
                if entry.skipped:
                    SkipReason(entry.skipped[0])
        except FileNotFoundError:
            return {}, ""
        except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError):
            return {}, f"{self._file} is damaged"
        return entries, ""

    def _save(self, entries: Mapping[str, _Entry]) -> None:
        content = {
            "format": _FORMAT,
            "settings": self._settings(),
            "photos": {name: asdict(entry) for name, entry in entries.items()},
        }
        write_json(self._file, content)

    def _settings(self) -> Any:
        # As JSON returns them: tuples become lists.
        return json.loads(json.dumps(asdict(self._describer.settings)))


def view_of(image_id: int, photo: ExtractedPhoto) -> View:
    """An extracted photo as one side of a pair, with its own camera."""
    catalog = CameraCatalog(CameraOptions(mode="per-image"))
    return View(image_id, catalog.camera_for(photo).camera, photo.features)


def _entry(photo: PhotoPath) -> _Entry:
    path = str(photo.path.resolve())
    try:
        status = photo.path.stat()
    except OSError:  # Extraction will report what is wrong.
        return _Entry(path, -1, -1)
    return _Entry(path, status.st_size, status.st_mtime_ns)


def _completed(entry: _Entry, result: CachedPhoto | Skipped) -> _Entry:
    if isinstance(result, Skipped):
        reason = result.reason.value, result.detail
        return _Entry(entry.path, entry.size, entry.mtime_ns, skipped=reason)
    return _Entry(entry.path, entry.size, entry.mtime_ns, result.photo.digest)

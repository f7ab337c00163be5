"""The photos of a session: image ids, names, digests, cameras and features."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from threading import Lock

import pycolmap

from sfm_front.photos.cameras import CameraCatalog
from sfm_front.photos.duplicates import DuplicateFinder
from sfm_front.types import ExtractedPhoto, Features, Skipped, StoredPhoto, Uint8Array, View


class PhotoCatalog(Mapping[int, View]):
    """Views by image id, counted from 1 in order of arrival.

    Features of photos that were not looked at for long are read again from where they are stored.
    May be read from several threads.
    """

    def __init__(
        self, cameras: CameraCatalog, stored: Callable[[int], Features], max_bytes: int
    ) -> None:
        """``stored`` gives the features of a photo that is no longer in memory; those in memory
        take ``max_bytes`` at most."""
        self._cameras = cameras
        self._duplicates = DuplicateFinder()
        self._camera_of: dict[int, pycolmap.Camera] = {}
        self._names: dict[int, str] = {}
        self._colors: dict[int, Uint8Array] = {}
        self._features = FeatureMemory(stored, max_bytes)

    def admit(self, photo: ExtractedPhoto) -> View | Skipped:
        """Give a photo that has just arrived its image id and camera; Skipped if it is a copy."""
        duplicate = self._duplicates.check(photo.name, photo.digest)
        if duplicate is not None:
            return duplicate
        image_id = len(self) + 1
        camera = self._cameras.camera_for(photo).camera
        self._enter(image_id, photo.name, camera, photo.features.colors)
        self._features.keep(image_id, photo.features)
        return self[image_id]

    def restore(self, photo: StoredPhoto, camera: pycolmap.Camera, colors: Uint8Array) -> None:
        """Enter a photo of an earlier run as it was; call in order of arrival."""
        self._duplicates.check(photo.name, photo.digest)
        self._cameras.remember(photo, camera)
        self._enter(photo.image_id, photo.name, camera, colors)

    def forget_features(self) -> None:
        """Hold none in memory: nothing is matched any more, and adjusting needs room."""
        self._features.clear()

    def name(self, image_id: int) -> str:
        """What the photo is called in the models."""
        return self._names[image_id]

    def camera(self, image_id: int) -> pycolmap.Camera:
        """A photo's, as it started with it."""
        return self._camera_of[image_id]

    @property
    def colors(self) -> Mapping[int, Uint8Array]:
        """Image id → (N, 3) uint8 RGB under each keypoint."""
        return self._colors

    def _enter(self, image_id: int, name: str, camera: pycolmap.Camera, colors: Uint8Array) -> None:
        self._camera_of[image_id] = camera
        self._names[image_id] = name
        self._colors[image_id] = colors

    def __getitem__(self, image_id: int) -> View:
        return View(image_id, self._camera_of[image_id], self._features[image_id])

    def __iter__(self) -> Iterator[int]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class FeatureMemory:
    """Features in memory, those not looked at for longest dropped first."""

    def __init__(self, stored: Callable[[int], Features], max_bytes: int) -> None:
        self._stored = stored
        self._max_bytes = max_bytes
        self._lock = Lock()
        self._kept: OrderedDict[int, Features] = OrderedDict()
        self._num_bytes = 0

    def keep(self, image_id: int, features: Features) -> None:
        """Hold on to them as long as there is room; the newest always stay."""
        with self._lock:
            self._kept[image_id] = features
            self._num_bytes += features.num_bytes
            while self._num_bytes > self._max_bytes and len(self._kept) > 1:
                _, dropped = self._kept.popitem(last=False)
                self._num_bytes -= dropped.num_bytes

    def clear(self) -> None:
        """Let go of all."""
        with self._lock:
            self._kept.clear()
            self._num_bytes = 0

    def __getitem__(self, image_id: int) -> Features:
        with self._lock:
            found = self._kept.get(image_id)
            if found is not None:
                self._kept.move_to_end(image_id)
                return found
        features = self._stored(image_id)
        self.keep(image_id, features)
        return features

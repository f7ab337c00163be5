"""The photos of a session: image ids, names, digests, cameras and features."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from sfm_front.photos.cameras import CameraCatalog, CameraOptions
from sfm_front.photos.duplicates import DuplicateFinder
from sfm_front.types import ExtractedPhoto, Skipped, View


class PhotoCatalog(Mapping[int, View]):
    """Views by image id, counted from 1 in order of arrival."""

    def __init__(self, cameras: CameraOptions) -> None:
        self._cameras = CameraCatalog(cameras)
        self._duplicates = DuplicateFinder()
        self._views: dict[int, View] = {}
        self._names: dict[int, str] = {}

    def admit(self, photo: ExtractedPhoto) -> View | Skipped:
        """Give a photo that has just arrived its image id and camera; Skipped if it is a copy."""
        duplicate = self._duplicates.check(photo.name, photo.digest)
        if duplicate is not None:
            return duplicate
        image_id = len(self) + 1
        view = View(image_id, self._cameras.camera_for(photo).camera, photo.features)
        self._views[image_id] = view
        self._names[image_id] = photo.name
        return view

    def name(self, image_id: int) -> str:
        """What the photo is called in the models."""
        return self._names[image_id]

    def __getitem__(self, image_id: int) -> View:
        return self._views[image_id]

    def __iter__(self) -> Iterator[int]:
        return iter(self._views)

    def __len__(self) -> int:
        return len(self._views)

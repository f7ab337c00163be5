"""Photos → DescribedPhotos: SIFT and the global vector side by side, the next photos ahead."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Protocol
from weakref import WeakSet

from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.sift import SiftExtractor
from sfm_front.photos.reader import PhotoReader
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.prefetch import prefetch
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.types import (
    ExtractedPhoto,
    Features,
    Float32Array,
    Photo,
    PhotoPath,
    Skipped,
    SkipReason,
)

if TYPE_CHECKING:
    from sfm_front.features.colmap_sift import ColmapSift


class FeatureExtractor(Protocol):
    """Finds the SIFT features of a photo; threads may share it.

    ``name`` tells apart extractors whose features must not be mixed.
    """

    @property
    def name(self) -> str: ...

    def extract(self, photo: Photo) -> Features: ...


def make_extractor(device: str, max_features: int) -> SiftExtractor | ColmapSift:
    """SIFT for a device that ``devices.usable_device`` has given: COLMAP's on a GPU if it can."""
    if device == "cuda":
        import pycolmap

        from sfm_front.features.colmap_sift import ColmapSift

        if pycolmap.has_cuda:
            return ColmapSift(max_features)
    return SiftExtractor(max_features)


class FeatureExtraction(Closeable):
    """Reads photos and describes them, several at a time.

    Of one photo, SIFT and the global vector's pixel share are computed in two parallel threads,
    as in the paper; VLAD follows SIFT.
    """

    def __init__(
        self,
        reader: PhotoReader,
        sift: FeatureExtractor,
        global_descriptor: GlobalDescriptor,
        *,
        num_threads: int,
    ) -> None:
        """``num_threads``: photos described at a time."""
        self._reader = reader
        self._sift = sift
        self._global = global_descriptor
        self._num_threads = num_threads
        self._networks = ThreadPoolExecutor(1, "sfm-network")
        self._streams: WeakSet[Generator[ExtractedPhoto | Skipped, None, None]] = WeakSet()

    def describe(self, photo: PhotoPath) -> ExtractedPhoto | Skipped:
        """Read one photo and describe it in the calling thread, networks in a second one."""
        clock = Stopwatch()
        with clock.stage("read"):
            read = self._reader.read(photo.path, photo.name)
        if isinstance(read, Skipped):
            return read
        network = self._networks.submit(self._describe_pixels, read, clock)
        with clock.stage("sift"):
            features = self._sift.extract(read)
        if len(features) == 0:
            network.cancel()
            return Skipped(photo.name, SkipReason.NO_FEATURES, "no texture to hold on to")
        with clock.stage("vlad"):
            of_features = self._global.describe_local(features)
        return ExtractedPhoto(
            name=read.name,
            path=read.path,
            width=read.width,
            height=read.height,
            digest=read.digest,
            exif=read.exif,
            features=features,
            global_vector=self._global.join(network.result(), of_features),
            seconds=clock.seconds,
        )

    def stream(self, photos: Iterable[PhotoPath]) -> Iterator[ExtractedPhoto | Skipped]:
        """Describe photos in order, up to twice as many ahead as are worked on at a time."""
        stream = prefetch(self.describe, photos, num_threads=self._num_threads)
        self._streams.add(stream)
        return stream

    def _describe_pixels(self, photo: Photo, clock: Stopwatch) -> Float32Array:
        if not self._global.needs_pixels:
            return self._global.describe_pixels(photo.pixels)
        with clock.stage("network"):
            return self._global.describe_pixels(photo.pixels)

    def close(self) -> None:
        # One that is still held would leave OpenCV and matrix products on one thread.
        for stream in tuple(self._streams):
            stream.close()
        self._networks.shutdown(cancel_futures=True)

"""Photos → ExtractedPhotos: SIFT and the global vector in parallel, photos prefetched."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Protocol, overload
from weakref import WeakSet

from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor
from sfm_front.features.sift import SiftExtractor, SiftOptions
from sfm_front.photos.reader import PhotoReader
from sfm_front.runtime.allocator import keep_freed_memory
from sfm_front.runtime.closeable import Closeable
from sfm_front.runtime.prefetch import prefetch
from sfm_front.runtime.stopwatch import Stopwatch
from sfm_front.types import (
    ExtractedPhoto,
    Features,
    Float32Array,
    NotYet,
    Photo,
    PhotoPath,
    Skipped,
    SkipReason,
)

if TYPE_CHECKING:
    from sfm_front.features.colmap_sift import ColmapSift


class FeatureExtractor(Protocol):
    """Extracts the SIFT features of a photo. Thread-safe.

    Features of extractors with different ``name`` must not be mixed.
    """

    @property
    def name(self) -> str: ...

    def extract(self, photo: Photo) -> Features: ...


def make_extractor(device: str, options: SiftOptions | None = None) -> SiftExtractor | ColmapSift:
    """SIFT for a device from ``devices.usable_device``: COLMAP's on a GPU if available.

    COLMAP's takes ``max_features`` alone of the options.
    """
    if device == "cuda":
        import pycolmap

        from sfm_front.features.colmap_sift import ColmapSift

        if pycolmap.has_cuda:
            return ColmapSift(options)
    return SiftExtractor(options)


class FeatureExtraction(Closeable):
    """Reads photos and describes them, several at a time.

    SIFT and the network part of the global vector run in two parallel threads per photo, as in
    the paper; VLAD follows SIFT.
    """

    def __init__(
        self,
        reader: PhotoReader,
        sift: FeatureExtractor,
        global_descriptor: GlobalDescriptor,
        *,
        num_threads: int,
    ) -> None:
        """``num_threads``: number of photos described in parallel."""
        keep_freed_memory()
        self._reader = reader
        self._sift = sift
        self._global = global_descriptor
        self._num_threads = num_threads
        self._networks = ThreadPoolExecutor(1, "sfm-network")
        self._streams: WeakSet[Generator[ExtractedPhoto | Skipped | NotYet, None, None]] = WeakSet()

    @property
    def global_descriptor(self) -> GlobalDescriptor:
        """What makes the global vectors."""
        return self._global

    def describe(self, photo: PhotoPath) -> ExtractedPhoto | Skipped:
        """Read and describe one photo in the calling thread; networks run in a second one."""
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

    @overload
    def stream(self, photos: Iterable[PhotoPath]) -> Iterator[ExtractedPhoto | Skipped]: ...
    @overload
    def stream(
        self, photos: Iterable[PhotoPath | NotYet]
    ) -> Iterator[ExtractedPhoto | Skipped | NotYet]: ...
    def stream(
        self, photos: Iterable[PhotoPath | NotYet]
    ) -> Iterator[ExtractedPhoto | Skipped | NotYet]:
        """Describe photos in order, prefetching up to twice ``num_threads``.

        ``NotYet`` is handed on when every photo before it is described and taken.
        """
        stream = prefetch(self.describe, photos, num_threads=self._num_threads)
        self._streams.add(stream)
        return stream

    def _describe_pixels(self, photo: Photo, clock: Stopwatch) -> Float32Array:
        if not self._global.needs_pixels:
            return self._global.describe_pixels(photo.pixels)
        with clock.stage("network"):
            return self._global.describe_pixels(photo.pixels)

    def close(self) -> None:
        # A stream left open would keep OpenCV and matrix products on one thread.
        for stream in tuple(self._streams):
            stream.close()
        self._networks.shutdown(cancel_futures=True)

"""What the tasks of a run share on one worker."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sfm_front.cluster.work import RunSettings
from sfm_front.errors import ConfigError, InputError
from sfm_front.features.extraction import FeatureExtraction, make_extractor
from sfm_front.features.feature_cache import ExtractionSettings, FeatureCache
from sfm_front.features.global_descriptors.descriptor import GlobalDescriptor, resolve
from sfm_front.photos.reader import PhotoReader
from sfm_front.runtime.devices import usable_device
from sfm_front.runtime.worker_pool import WorkerPool
from sfm_front.session.catalog import FeatureMemory
from sfm_front.session.matching_parts import make_matching
from sfm_front.session.options import SessionOptions
from sfm_front.types import Features

# Of a worker's features: many workers may share a machine.
_MAX_CACHE_BYTES = 512 * 2**20


@dataclass(slots=True)
class Counts:
    """What a task read, and how much of it was done already."""

    bytes_in: int = 0
    bytes_out: int = 0
    items: int = 0
    reused: int = 0


class Workbench:
    """Makes what a session would, each part once; the parts end with it."""

    def __init__(self, settings: RunSettings) -> None:
        """Raises ConfigError if this worker would describe photos in another way."""
        self.settings = settings
        self.options = replace(settings.options, threads=1)
        device, _ = usable_device(self.options.device)
        descriptor, _ = resolve(
            self.options.global_descriptor,
            weights=self.options.weights,
            vlad_weight=self.options.vlad_weight,
            device=device,
        )
        if descriptor.fingerprint != settings.descriptor:
            raise ConfigError(
                f"this worker has {descriptor.fingerprint}, the coordinator {settings.descriptor}: "
                "give both the same weights"
            )
        reader = PhotoReader(max_image_size=self.options.max_image_size)
        sift = make_extractor(device, self.options.sift)
        self.extraction = FeatureExtraction(reader, sift, descriptor, num_threads=1)
        self.keys = _settings(reader, sift.fingerprint, descriptor)
        self.cache = None if settings.cache is None else FeatureCache(settings.cache)
        self.matching = make_matching(self.options, device, WorkerPool(1))
        self.feature_keys: dict[int, str] = {}
        self.sent: dict[int, Features] = {}
        most = min(self.options.cache_bytes, _MAX_CACHE_BYTES)
        self.features = FeatureMemory(self._load, most)
        self.bytes_read = 0

    def _load(self, image_id: int) -> Features:
        """Of a photo whose key is known, or that was sent."""
        if image_id in self.sent:
            return self.sent[image_id]
        cache = self.cache
        local = None if cache is None else cache.load_local(self.feature_keys[image_id])
        if local is None:
            raise InputError(f"the features of image {image_id} are not in {self.settings.cache}")
        self.bytes_read += local.features.num_bytes
        return local.features


def extraction_settings(
    options: SessionOptions, descriptor: GlobalDescriptor
) -> ExtractionSettings:
    """By which coordinator and workers find features of the same photo."""
    device, _ = usable_device(options.device)
    sift = make_extractor(device, options.sift)
    return _settings(
        PhotoReader(max_image_size=options.max_image_size), sift.fingerprint, descriptor
    )


def _settings(reader: PhotoReader, sift: str, descriptor: GlobalDescriptor) -> ExtractionSettings:
    sizes = reader.max_image_size, reader.min_image_size
    return ExtractionSettings(*sizes, sift, (descriptor.fingerprint,))

"""Global vectors by name: one descriptor, or several joined into one vector.

A joined vector concatenates its parts, each of length 1 times the square root of its weight, so
that the cosine of two photos is the weighted mean of their parts' cosines.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from sfm_front.errors import ConfigError, DependencyError, WeightsError
from sfm_front.features.global_descriptors import weights_download as weights_cache
from sfm_front.features.global_descriptors.cnn import NETWORKS, CnnDescriptor
from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.features.global_descriptors.vlad import Vlad
from sfm_front.features.global_descriptors.weights_download import Progress
from sfm_front.types import Features, Float32Array, Uint8Array

AUTO = "auto"
NAMES = (*NETWORKS, Vlad.name)

AUTO_NETWORK = "resnet101_pool5"
"""The paper's network, which ``auto`` joins with VLAD if available."""

VLAD_WEIGHT = 0.8
"""VLAD's default weight beside one network: best recall at 25 with MobileNetV2; ResNet101 was not
measured (TUNING: vlad-weight)."""


Source_contra = TypeVar("Source_contra", contravariant=True)


class GlobalDescriptorPart(Protocol[Source_contra]):
    """Describes a photo by its pixels, (h, w, 3) uint8 RGB, or by its features."""

    @property
    def name(self) -> str: ...

    @property
    def dimension(self) -> int: ...

    @property
    def fingerprint(self) -> str:
        """Equal for two descriptors only if their vectors are comparable."""
        ...

    def describe(self, source: Source_contra, /) -> Float32Array:
        """(dimension,) float32 of length 1; zeros if there is nothing to describe."""
        ...


class GlobalDescriptor:
    """Describes a photo for retrieval: (dimension,) float32 of length 1, compared by cosine.

    The parts from pixels and from features can be computed separately, so that networks run in
    parallel to SIFT; ``join`` combines them. Thread-safe.
    """

    def __init__(
        self,
        *,
        networks: Sequence[GlobalDescriptorPart[Uint8Array]] = (),
        local: Sequence[GlobalDescriptorPart[Features]] = (),
        vlad_weight: float = VLAD_WEIGHT,
    ) -> None:
        """``networks`` describe pixels, ``local`` describe features; at least one in total.

        Each of ``local`` weighs ``vlad_weight``, each of ``networks`` the rest up to 1. Raises
        ConfigError for a weight that ``check_vlad_weight`` refuses.
        """
        check_vlad_weight(vlad_weight)
        parts: list[GlobalDescriptorPart[Any]] = [*networks, *local]
        self.name = "+".join(part.name for part in parts)
        self.dimension = sum(part.dimension for part in parts)
        self.fingerprint = "+".join(part.fingerprint for part in parts)
        if networks and local:
            self.fingerprint += f":vlad_weight={vlad_weight}"
        self.needs_pixels = len(networks) > 0
        network_weight = 1 - vlad_weight
        total = network_weight * len(networks) + vlad_weight * len(local)
        self._networks = tuple(networks)
        self._network_factor = np.float32((network_weight / total) ** 0.5)
        self._local = tuple(local)
        self._local_factor = np.float32((vlad_weight / total) ** 0.5)

    def describe_pixels(self, pixels: Uint8Array) -> Float32Array:
        """(h, w, 3) uint8 RGB → the networks' part; empty if there is none."""
        vectors = [part.describe(pixels) for part in self._networks]
        share: Float32Array = self._network_factor * _side_by_side(vectors)
        return share

    def describe_local(self, features: Features) -> Float32Array:
        """SIFT features → VLAD's part; empty if there is none."""
        vectors = [part.describe(features) for part in self._local]
        share: Float32Array = self._local_factor * _side_by_side(vectors)
        return share

    def join(self, of_pixels: Float32Array, of_features: Float32Array) -> Float32Array:
        """Both parts → (dimension,) float32 of length 1."""
        # Not yet of length 1 if a photo has no features, hence no VLAD.
        return unit_length(np.concatenate([of_pixels, of_features]))

    def describe(self, pixels: Uint8Array, features: Features) -> Float32Array:
        """Both parts, joined: (dimension,) float32 of length 1."""
        return self.join(self.describe_pixels(pixels), self.describe_local(features))


def check_vlad_weight(weight: float) -> None:
    """Raise ConfigError unless both VLAD and the networks it is joined with count."""
    if not 0 < weight < 1:
        raise ConfigError(f"vlad_weight must be above 0 and below 1, got {weight}")


def resolve(
    name: str,
    *,
    weights: Path | None = None,
    vlad_weight: float = VLAD_WEIGHT,
    device: str = "cpu",
    progress: Progress | None = None,
) -> tuple[GlobalDescriptor, str | None]:
    """The descriptor called ``name``, and a message for the user about the choice, if any.

    ``name`` is one of ``NAMES``, several joined by ``+``, or ``auto``: ResNet101 joined with VLAD
    if its weights are cached or can be downloaded, else VLAD. ``weights`` replaces the network's
    official file; ``vlad_weight`` is VLAD's beside one network; ``progress`` is called during a
    download.

    Raises:
        ConfigError: no such name, one twice, ``weights`` without exactly one network, or a wrong
            ``vlad_weight``.
        WeightsError: weights requested by name or file are unavailable or unusable.
        DependencyError: a network was requested and torch cannot be loaded.
    """
    if name == AUTO:
        return _automatic(weights, vlad_weight, device, progress)
    parts = _split(name)
    networks = [part for part in parts if part in NETWORKS]
    if weights is not None and len(networks) != 1:
        raise ConfigError(
            f"--weights goes with one network of {', '.join(NETWORKS)}: "
            f"{name!r} has {len(networks) or 'none'}"
        )
    describers = [_network(part, weights, device, progress) for part in networks]
    local = [Vlad()] if Vlad.name in parts else []
    return GlobalDescriptor(networks=describers, local=local, vlad_weight=vlad_weight), None


def _automatic(
    weights: Path | None, vlad_weight: float, device: str, progress: Progress | None
) -> tuple[GlobalDescriptor, str]:
    joined = f"{AUTO_NETWORK}+{Vlad.name}"
    if weights is not None:
        descriptor, _ = resolve(joined, weights=weights, vlad_weight=vlad_weight, device=device)
        return descriptor, f"global descriptor: {joined}, with weights from {weights.name}"
    try:
        descriptor, _ = resolve(joined, vlad_weight=vlad_weight, device=device, progress=progress)
    except (WeightsError, DependencyError) as error:
        alone = f"similar photos are found by {Vlad.name} alone: {error}"
        return GlobalDescriptor(local=[Vlad()]), alone
    return descriptor, f"global descriptor: {joined}, with torchvision's weights"


def _split(name: str) -> list[str]:
    parts = name.split("+")
    valid = f"{', '.join(NAMES)}, any of them joined by '+', or {AUTO}"
    for part in parts:
        if part not in NAMES:
            raise ConfigError(f"no global descriptor is called {part!r}: choose {valid}")
    if len(set(parts)) < len(parts):
        raise ConfigError(f"global descriptor {name!r} names a part twice: choose {valid}")
    return parts


def _network(
    name: str, weights: Path | None, device: str, progress: Progress | None
) -> CnnDescriptor:
    if weights is None:
        weights = weights_cache.cached_or_fetched(NETWORKS[name].weights_url, progress=progress)
    return CnnDescriptor(name, weights=weights, device=device)


def _side_by_side(parts: list[Float32Array]) -> Float32Array:
    return np.concatenate(parts) if parts else np.zeros(0, np.float32)

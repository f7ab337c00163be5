"""A photo's pixels → global vector, by a pretrained network."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import cv2
import numpy as np

from sfm_front.errors import ConfigError, DependencyError
from sfm_front.features.global_descriptors import weights_download as weights_cache
from sfm_front.features.global_descriptors.unit_vectors import unit_length
from sfm_front.types import Float32Array, Uint8Array

if TYPE_CHECKING:
    import torch

    from sfm_front.features.global_descriptors.networks import DescriptorNetwork

# ImageNet statistics, RGB in [0, 1]; all three networks were trained with them.
MEAN_RGB = np.array([0.485, 0.456, 0.406], np.float32)
STD_RGB = np.array([0.229, 0.224, 0.225], np.float32)

# Below this, AlexNet's first layers leave nothing to pool.
SHORTEST_SIDE_PX = 64


@dataclass(frozen=True, slots=True)
class Network:
    """A named network: its class, its weights and its input size.

    ``class_name`` is looked up in ``networks`` on first use only, because that loads torch.
    ``longer_side_px``: photos are reduced to this.
    """

    class_name: str
    dimension: int
    weights_url: str
    longer_side_px: int


# Above 320 px accuracy hardly grows; ResNet101 gets 224 px to save time (TUNING: network-size).
_MODELS = "https://download.pytorch.org/models"

NETWORKS: Mapping[str, Network] = MappingProxyType(
    {
        "resnet101_pool5": Network(
            "ResNet101", 2048, f"{_MODELS}/resnet101-63fe2227.pth", longer_side_px=224
        ),
        "alexnet_fc7": Network(
            "AlexNet", 4096, f"{_MODELS}/alexnet-owt-7be5be79.pth", longer_side_px=320
        ),
        "mobilenet_v2": Network(
            "MobileNetV2", 1280, f"{_MODELS}/mobilenet_v2-b0353104.pth", longer_side_px=320
        ),
    }
)


class CnnDescriptor:
    """Describes photos by one network. Thread-safe."""

    def __init__(self, name: str, *, weights: Path, device: str = "cpu") -> None:
        """``name`` is one of ``NETWORKS``, ``weights`` its file, ``device`` a torch device name.

        Raises:
            WeightsError: the file is broken or another network's.
            ConfigError: torch cannot use this device.
            DependencyError: torch cannot be loaded.
        """
        self.name = name
        self.network = NETWORKS[name]
        self.dimension = self.network.dimension
        self._module, self._device = _load(self.network, weights, device)
        digest = weights_cache.sha256(weights)[:8]
        self.fingerprint = f"{name}:{digest}:{self.network.longer_side_px}"

    def describe(self, pixels: Uint8Array) -> Float32Array:
        """(h, w, 3) uint8 RGB of any size → (dimension,) float32 of length 1."""
        import torch

        batch = torch.from_numpy(preprocess(pixels, self.network.longer_side_px))
        with torch.inference_mode():
            output = self._module(batch.to(self._device))
        vector: Float32Array = output[0].cpu().numpy()
        return unit_length(vector)


def preprocess(pixels: Uint8Array, longer_side_px: int) -> Float32Array:
    """(h, w, 3) uint8 RGB → (1, 3, H, W) float32: the whole photo, reduced and normalised.

    Nothing is cropped: photos often overlap at their borders. The longer side becomes
    ``longer_side_px`` if it is above that; a side never falls below ``SHORTEST_SIDE_PX``.
    """
    height, width = pixels.shape[:2]
    scale = min(1.0, longer_side_px / max(height, width))
    size = tuple(max(SHORTEST_SIDE_PX, round(side * scale)) for side in (width, height))
    # A photo already of this size stays unchanged.
    reduced = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    normalised = (reduced.astype(np.float32) / 255.0 - MEAN_RGB) / STD_RGB
    return np.ascontiguousarray(normalised.transpose(2, 0, 1)[np.newaxis])


def _load(
    network: Network, weights: Path, device_name: str
) -> tuple[DescriptorNetwork, torch.device]:
    try:
        import torch

        from sfm_front.features.global_descriptors import networks
        from sfm_front.features.global_descriptors.weights import load_weights
    except (ImportError, OSError) as error:  # OSError: a shared library is missing
        raise DependencyError(
            f"torch cannot be loaded ({error}). Install it, or use --global-descriptor vlad."
        ) from error
    device = _device(device_name)
    # Built without storage: every parameter in use comes from the file.
    with torch.device("meta"):
        module: DescriptorNetwork = getattr(networks, network.class_name)()
    expected = weights_cache.file_name(network.weights_url)
    load_weights(module, weights, expected=expected, device=device)
    return module.eval(), device


def _device(name: str) -> torch.device:
    import torch

    try:
        device = torch.device(name)
        torch.empty(0, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise ConfigError(f"device {name!r} cannot be used ({reason}). Use cpu.") from error
    return device

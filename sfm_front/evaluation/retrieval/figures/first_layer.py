"""A network's first layer: its kernels and their responses to a photo, the paper's figure 2."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sfm_front.features.global_descriptors.cnn import NETWORKS, preprocess
from sfm_front.features.global_descriptors.weights_download import file_name
from sfm_front.types import Float32Array, Uint8Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_GAP = 1


@dataclass(frozen=True, slots=True, eq=False)
class FirstLayer:
    """``kernels`` (n, k, k, 3): weights for red, green and blue. ``responses`` (n, h, w): their
    outputs after the ReLU, not negative."""

    kernels: Float32Array
    responses: Float32Array


def first_layer(network: str, weights: Path, pixels: Uint8Array) -> FirstLayer:
    """Run ``network``, one of ``NETWORKS``, on (h, w, 3) uint8 RGB and return its first layer.

    Raises ``WeightsError`` if the file is broken or another network's.
    """
    import torch
    from torch import nn

    from sfm_front.features.global_descriptors import networks
    from sfm_front.features.global_descriptors.weights import load_weights

    known = NETWORKS[network]
    with torch.device("meta"):
        module: networks.DescriptorNetwork = getattr(networks, known.class_name)()
    expected = file_name(known.weights_url)
    load_weights(module, weights, expected=expected, device=torch.device("cpu"))
    convolution = next(part for part in module.modules() if isinstance(part, nn.Conv2d))
    activation = next(part for part in module.modules() if isinstance(part, (nn.ReLU, nn.ReLU6)))
    seen: list[Float32Array] = []

    def keep(_module: nn.Module, _inputs: Any, output: torch.Tensor) -> None:
        seen.append(output[0].numpy().copy())  # later layers work in place

    handle = activation.register_forward_hook(keep)
    with torch.inference_mode():
        module.eval()(torch.from_numpy(preprocess(pixels, known.longer_side_px)))
    handle.remove()
    kernels = convolution.weight.detach().numpy().transpose(0, 2, 3, 1)
    return FirstLayer(np.ascontiguousarray(kernels), seen[0])


def draw_first_layer(layer: FirstLayer, pixels: Uint8Array, title: str) -> Figure:
    """The photo, the kernels and their maps; each kernel and map stretched to its own range."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 4.4), layout="constrained")
    photo, kernels, responses = figure.subplots(1, 3, width_ratios=(1, 1, 1.6))
    photo.imshow(pixels)
    photo.set_title(title, fontsize=9)
    count, height, width = layer.responses.shape
    side = layer.kernels.shape[1]
    kernels.imshow(mosaic(layer.kernels), interpolation="nearest")
    kernels.set_title(f"{count} kernels of {side} x {side} pixels", fontsize=9)
    responses.imshow(mosaic(layer.responses), cmap="gray", interpolation="nearest")
    responses.set_title(f"their responses, {width} x {height} each", fontsize=9)
    for panel in (photo, kernels, responses):
        panel.set_axis_off()
    return figure


def mosaic(tiles: Float32Array) -> Float32Array:
    """(n, h, w) or (n, h, w, 3) → one picture in [0, 1]: a nearly square grid, white between."""
    columns = int(np.ceil(np.sqrt(len(tiles))))
    lines = -(-len(tiles) // columns)
    height, width = tiles.shape[1:3]
    shape = (lines * (height + _GAP) - _GAP, columns * (width + _GAP) - _GAP, *tiles.shape[3:])
    picture = np.ones(shape, np.float32)
    for number, tile in enumerate(tiles):
        top = number // columns * (height + _GAP)
        left = number % columns * (width + _GAP)
        picture[top : top + height, left : left + width] = _stretched(tile)
    return picture


def _stretched(tile: Float32Array) -> Float32Array:
    span = float(tile.max() - tile.min())
    stretched: Float32Array = (tile - tile.min()) / span if span else np.zeros_like(tile)
    return stretched

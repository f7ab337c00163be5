"""Load a weights file and check it against its network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sfm_front.errors import WeightsError
from sfm_front.features.global_descriptors.networks import DescriptorNetwork

NAMED_LAYERS = 3
"""Number of layers named in an error message; the rest are only counted."""


def load_weights(
    network: DescriptorNetwork, file: Path, *, expected: str, device: torch.device
) -> None:
    """Fill ``network`` from ``file``, in float32 on ``device``.

    The file is a state_dict in torchvision's naming, bare or as ``{"state_dict": …}``, with or
    without DataParallel's ``module.`` prefix, and with or without the classifier, which is not
    used. Pickled code is never run. ``network`` may have been built on torch's meta device; the
    classifier stays there. ``expected`` is the official file's name, for the error message.

    Raises:
        WeightsError: the file cannot be read, or is not of this network: layers are missing, have
            another shape, or are unknown (as in a deeper network of the same family).
    """
    state = read_state_dict(file, expected=expected)
    problem = _mismatch(state, network)
    if problem:
        raise WeightsError(f"{file.name}: {problem}. Expected torchvision's {expected}.")
    weights = {
        name: state[name].to(device, torch.float32)
        for name in network.state_dict()
        if name in state and not name.startswith(network.HEAD)
    }
    network.load_state_dict(weights, strict=False, assign=True)


def read_state_dict(file: Path, *, expected: str) -> dict[str, Tensor]:
    """The tensors in ``file`` by name, on the CPU, without the wrappers of training scripts.

    Raises:
        WeightsError: the file is missing, damaged, or holds anything but tensors by name.
    """
    if not file.is_file():
        raise WeightsError(f"{file}: no such file. Expected torchvision's {expected}.")
    try:
        content: Any = torch.load(file, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises a different exception for each kind of damage
        raise WeightsError(
            f"{file.name}: cannot be read as weights: cut off, or not a plain state_dict. "
            f"Download torchvision's {expected} again."
        ) from error
    if isinstance(content, Mapping) and isinstance(content.get("state_dict"), Mapping):
        content = content["state_dict"]
    if not _is_state_dict(content):
        raise WeightsError(f"{file.name}: holds no state_dict. Expected torchvision's {expected}.")
    return {name.removeprefix("module."): tensor for name, tensor in content.items()}


def _is_state_dict(content: object) -> bool:
    return isinstance(content, Mapping) and all(
        isinstance(name, str) and isinstance(tensor, Tensor) for name, tensor in content.items()
    )


def _mismatch(state: Mapping[str, Tensor], network: DescriptorNetwork) -> str:
    """Why ``state`` cannot be the weights of ``network``; empty if it can."""
    known = network.state_dict()
    needed = {
        name: tensor.shape
        for name, tensor in known.items()
        # The count of batches is for training only, and older files lack it.
        if not name.startswith(network.HEAD) and not name.endswith(".num_batches_tracked")
    }
    missing = [name for name in needed if name not in state]
    misshapen = [
        name for name, shape in needed.items() if name in state and state[name].shape != shape
    ]
    unknown = [name for name in state if name not in known and not name.startswith(network.HEAD)]
    findings = [
        _count(missing, "missing"),
        _count(misshapen, "of another shape"),
        _count(unknown, "unknown"),
    ]
    told = ", ".join(finding for finding in findings if finding)
    foreign = len(missing) + len(misshapen) > len(needed) // 2
    return f"not weights of {type(network).__name__}: {told}" if foreign else told


def _count(names: list[str], what: str) -> str:
    """``2 layers missing (conv1.weight, bn1.weight)``, or nothing for none."""
    if not names:
        return ""
    layers = "1 layer" if len(names) == 1 else f"{len(names)} layers"
    shown = ", ".join(names[:NAMED_LAYERS]) + (", …" if len(names) > NAMED_LAYERS else "")
    return f"{layers} {what} ({shown})"

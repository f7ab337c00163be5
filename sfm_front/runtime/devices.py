"""Where networks and matching run: on a GPU if there is one."""

from __future__ import annotations

import ctypes.util
import os
from pathlib import Path

from sfm_front.errors import ConfigError

DEVICES = ("auto", "cpu", "cuda")


def usable_device(name: str) -> tuple[str, str | None]:
    """``cpu`` or ``cuda``, and a message for the user if that is not what was requested.

    ``auto`` is a GPU if PyTorch can use one. PyTorch takes seconds to load, so it is loaded only
    if there is an NVIDIA driver. Raises ConfigError for any name not in ``DEVICES``.
    """
    if name not in DEVICES:
        raise ConfigError(f"device must be one of {', '.join(DEVICES)}, got {name!r}")
    if name == "cpu":
        return "cpu", None
    reason = _why_not_cuda()
    if reason is None:
        return "cuda", None
    return "cpu", None if name == "auto" else f"device cuda: {reason}; running on the CPU"


def _why_not_cuda() -> str | None:
    if not _has_driver():
        return "no NVIDIA driver is installed"
    try:
        import torch
    except (ImportError, OSError) as error:  # OSError: a shared library is missing
        return f"torch cannot be loaded ({error})"
    if not torch.cuda.is_available():
        return "this PyTorch cannot use the GPU"
    return None


def _has_driver() -> bool:
    if os.name == "posix" and Path("/dev/nvidiactl").exists():
        return True
    return ctypes.util.find_library("nvcuda" if os.name == "nt" else "cuda") is not None

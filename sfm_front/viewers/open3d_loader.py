"""Import Open3D, or say what is missing."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from sfm_front.errors import DependencyError

SYSTEM_PACKAGES = (
    "libegl1 libgl1 libgomp1 libidn2-0 libusb-1.0-0 libvulkan1 libx11-6 mesa-vulkan-drivers"
)
INSTALL_HINT = f"on Debian or Ubuntu: apt-get install {SYSTEM_PACKAGES}"


def load_open3d() -> Any:
    """The open3d module.

    Raises ``DependencyError``, in one line, if it is not installed or a system library that it
    links to is missing.
    """
    try:
        return import_module("open3d")
    except ModuleNotFoundError as error:
        raise DependencyError(f"{error}: the viewer needs it; pip install open3d") from error
    except (ImportError, OSError) as error:
        reason = (str(error).splitlines() or ["unknown reason"])[0]
        raise DependencyError(f"open3d cannot load ({reason}); {INSTALL_HINT}") from error

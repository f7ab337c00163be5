"""The machine a benchmark ran on."""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

from sfm_front.session.options import available_cores


def machine() -> dict[str, Any]:
    """Processor, number of cores and the versions that affect speed; ready for JSON."""
    return {
        "cpu": _cpu_name(),
        "cores": available_cores(),
        "python": platform.python_version(),
        "pycolmap": version("pycolmap"),
        "opencv": version("opencv-python-headless"),
    }


def _cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()

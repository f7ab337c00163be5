"""Structure-from-Motion that keeps up with the camera.

``from sfm_front import Session, SessionOptions``: see ``sfm_front.session.session``.
"""

from __future__ import annotations

# pycolmap's wheels export a zlib of their own; loaded before Python's, it breaks compression in
# the whole process.
import zlib  # noqa: F401
from importlib import import_module
from typing import TYPE_CHECKING, Any

from sfm_front.version import VERSION

if TYPE_CHECKING:
    from sfm_front.errors import (
        ConfigError,
        DependencyError,
        InputError,
        SfmFrontError,
        WeightsError,
    )
    from sfm_front.events import Event, PhotoAdded
    from sfm_front.session.options import SessionOptions
    from sfm_front.session.session import Session
    from sfm_front.session.summing_up import SessionResult
    from sfm_front.types import ModelSummary, PhotoPath, Skipped

__version__ = VERSION
__all__ = [
    "ConfigError",
    "DependencyError",
    "Event",
    "InputError",
    "ModelSummary",
    "PhotoAdded",
    "PhotoPath",
    "Session",
    "SessionOptions",
    "SessionResult",
    "SfmFrontError",
    "Skipped",
    "WeightsError",
    "__version__",
]

# Loaded when asked for: pycolmap and OpenCV would delay the answer of --help.
_MODULES = {
    "ConfigError": "errors",
    "DependencyError": "errors",
    "Event": "events",
    "InputError": "errors",
    "ModelSummary": "types",
    "PhotoAdded": "events",
    "PhotoPath": "types",
    "Session": "session.session",
    "SessionOptions": "session.options",
    "SessionResult": "session.summing_up",
    "SfmFrontError": "errors",
    "Skipped": "types",
    "WeightsError": "errors",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"sfm_front.{_MODULES[name]}"), name)

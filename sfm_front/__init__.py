"""Structure-from-Motion that keeps up with the camera.

``from sfm_front import Session, SessionOptions``: see ``sfm_front.session.session``.
"""

from __future__ import annotations

# pycolmap's wheels export a zlib of their own; loaded before Python's, it breaks compression in
# the whole process.
import zlib  # noqa: F401
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sfm_front.session.options import SessionOptions
    from sfm_front.session.session import Session

__version__ = "0.1.0"
__all__ = ["Session", "SessionOptions", "__version__"]


def __getattr__(name: str) -> Any:
    # Loaded when asked for: pycolmap and OpenCV would delay the answer of --help.
    if name == "Session":
        from sfm_front.session.session import Session

        return Session
    if name == "SessionOptions":
        from sfm_front.session.options import SessionOptions

        return SessionOptions
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

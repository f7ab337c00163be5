"""Read a pickle of plain data without running any code from it.

A pickle may have any function called while it is read. This reader allows only what numpy arrays
need.
"""

from __future__ import annotations

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np

from sfm_front.errors import InputError

_RECONSTRUCT = np.zeros(0).__reduce__()[0]
_SCALAR = np.float64(0).__reduce__()[0]


def _bytes_of(text: str, encoding: str) -> bytes:
    if encoding != "latin1":
        raise pickle.UnpicklingError(f"it asks for the encoding {encoding}")
    return text.encode(encoding)


def _no_bytes() -> bytes:
    return b""


_ALLOWED: dict[tuple[str, str], Any] = {
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
    # numpy 2 moved its core: files of both ages must be readable with both.
    ("numpy.core.multiarray", "_reconstruct"): _RECONSTRUCT,
    ("numpy._core.multiarray", "_reconstruct"): _RECONSTRUCT,
    ("numpy.core.multiarray", "scalar"): _SCALAR,
    ("numpy._core.multiarray", "scalar"): _SCALAR,
    # Bytes as Python 3 writes them for Python 2.
    ("_codecs", "encode"): _bytes_of,
    ("__builtin__", "bytes"): _no_bytes,
}


class _PlainUnpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        try:
            return _ALLOWED[module, name]
        except KeyError:
            raise pickle.UnpicklingError(f"it asks for {module}.{name}") from None


def read_plain_pickle(file: Path) -> Any:
    """The content of ``file``: dictionaries, lists, text, numbers and arrays.

    Raises ``InputError`` if it is damaged or holds anything else.
    """
    try:
        # In a pickle written by Python 2, strings, also those of arrays, are bytes in any encoding.
        return _PlainUnpickler(io.BytesIO(file.read_bytes()), encoding="latin1").load()
    except Exception as error:  # a damaged pickle raises anything
        reason = str(error) or type(error).__name__
        raise InputError(
            f"{file}: cannot be read: it is damaged or holds more than plain data ({reason}); "
            "download it again"
        ) from error

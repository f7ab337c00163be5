"""How the C library treats memory that is freed."""

from __future__ import annotations

import ctypes
import sys

# From <malloc.h>.
_M_TRIM_THRESHOLD = -1
_M_TOP_PAD = -2
_M_MMAP_THRESHOLD = -3


def keep_freed_memory() -> bool:
    """Have freed memory used again instead of given back: False if the C library cannot.

    SIFT asks for the same hundreds of megabytes for each photo. Those that glibc has given back
    to the system meanwhile come as pages that must be cleared one by one.
    """
    if sys.platform != "linux":
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:  # not glibc
        return False
    settings = {
        # Everything up to the largest size allowed is taken from a heap, not from the system.
        _M_MMAP_THRESHOLD: 2**25,
        # The main heap keeps its free end up to here.
        _M_TRIM_THRESHOLD: 2**30,
        # Threads have heaps of 64 MiB: an empty one goes back only if the one before it has more
        # than this left.
        _M_TOP_PAD: 2**26,
    }
    return all(mallopt(name, value) for name, value in settings.items())

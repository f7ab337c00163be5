"""Memory that is freed is used again."""

from __future__ import annotations

import subprocess
import sys

import pytest

from sfm_front.runtime.allocator import keep_freed_memory

# Faults of pages while four pieces of 30 MiB are taken, written to and freed 50 times.
_FAULTS = """
import resource, sys, threading
from sfm_front.runtime.allocator import keep_freed_memory
if sys.argv[1] == "keep":
    assert keep_freed_memory()
def faults():
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt
def work():
    before = faults()
    for _ in range(50):
        taken = [b"x" * (30 * 2**20) for _ in range(4)]
        del taken
    print(faults() - before)
thread = threading.Thread(target=work)
thread.start()
thread.join()
"""


def _faults(how: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", _FAULTS, how], capture_output=True, text=True, check=True
    )
    return int(done.stdout)


@pytest.mark.skipif(not keep_freed_memory(), reason="the C library gives freed memory back")
def test_freed_memory_is_not_given_back():
    assert 4 * _faults("keep") < _faults("default")

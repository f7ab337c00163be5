"""What holds for all tests."""

from __future__ import annotations

import os

# As in a session, whose workers keep OpenMP on the thread that asks. On all cores its threads wait
# by spinning, and take them from the tests and programs beside them. Read when a library loads.
os.environ.setdefault("OMP_NUM_THREADS", "1")

"""SQLite's write-ahead log: where its transactions end.

Its format: sqlite.org/fileformat2.html#the_write_ahead_log.
"""

from __future__ import annotations

import struct
from pathlib import Path

HEADER_BYTES = 32
_FRAME_HEADER_BYTES = 24
# In the file of shared memory, nBackfillAttempted: frames that are being moved into the database,
# or have been (sqlite.org/walformat.html#the_wal_index_header).
_NUM_MOVED_AT = 128


def commit_ends(wal: Path) -> list[int]:
    """Offsets at which a transaction is whole, of the log's present round, in order."""
    data = wal.read_bytes()
    if len(data) < HEADER_BYTES:
        return []
    page_bytes = struct.unpack_from(">I", data, 8)[0]
    salt = data[16:24]
    ends = []
    step = _FRAME_HEADER_BYTES + page_bytes
    for start in range(HEADER_BYTES, len(data) - step + 1, step):
        _, pages_after_commit = struct.unpack_from(">II", data, start)
        if data[start + 8 : start + 16] != salt:
            break  # Left from the round before.
        if pages_after_commit:
            ends.append(start + step)
    return ends


def moved_until(wal: Path, shared_memory: Path) -> int:
    """The offset up to which the log may have been moved into the database, after it was synced."""
    page_bytes = struct.unpack_from(">I", wal.read_bytes(), 8)[0]
    num_moved = struct.unpack_from("=I", shared_memory.read_bytes(), _NUM_MOVED_AT)[0]
    return HEADER_BYTES + int(num_moved) * (_FRAME_HEADER_BYTES + int(page_bytes))

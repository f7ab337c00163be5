"""Writes the files to look at beside a session that goes on: OUTPUT; ``files_beside_session`` runs
it.

It prints the seconds of processor time that this took.
"""

from __future__ import annotations

import sys
import time
import zlib  # noqa: F401  (before pycolmap)
from pathlib import Path

from sfm_front.live_page.files import write_files
from sfm_front.runtime.priority import let_others_first

# Whatever the session leaves: nobody waits for these files.
_NICE = 19


def main(output: Path) -> None:
    """Write them once."""
    let_others_first(_NICE)
    write_files(output)
    print(time.process_time())


if __name__ == "__main__":
    main(Path(sys.argv[1]))

"""Writes ``report.html`` beside a session that goes on: OUTPUT; ``beside_session`` runs it.

It prints the seconds of processor time that this took.
"""

from __future__ import annotations

import sys
import time
import zlib  # noqa: F401  (before pycolmap)
from pathlib import Path

from sfm_front.reports.html.page import write_page
from sfm_front.runtime.priority import let_others_first

# Whatever the session leaves: nobody waits for this page.
_NICE = 19


def main(output: Path) -> None:
    """Write the page once."""
    let_others_first(_NICE)
    write_page(output)
    print(time.process_time())


if __name__ == "__main__":
    main(Path(sys.argv[1]))

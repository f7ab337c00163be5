"""The page of ``reconstruct --viewer``, in a process of its own: OUTPUT PORT.

It prints its address. Its session says ``ended`` on standard input when all is written: then the
page stays while a browser shows it. It ends with its session's process in any case.
"""

from __future__ import annotations

import signal
import sys
import time
import zlib  # noqa: F401  (before pycolmap)
from pathlib import Path
from threading import Event, Thread

from sfm_front.live_page.server import LivePage
from sfm_front.runtime.priority import let_others_first

# A page that is loaded anew is without its browser for a moment.
_PATIENCE_S = 3.0
_NICE = 10


def main(output: Path, port: int) -> None:
    """Serve the page until it is no longer wanted."""
    let_others_first(_NICE)
    has_ended, is_alone = Event(), Event()
    Thread(target=_listen, args=(has_ended, is_alone), daemon=True).start()
    last_seen_s = float("-inf")

    with LivePage(output, port) as page:
        # pycolmap would write a page of its own.
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        print(page.address, flush=True)

        def is_unwanted() -> bool:
            nonlocal last_seen_s
            if page.num_browsers:
                last_seen_s = time.monotonic()
            forsaken = time.monotonic() - last_seen_s > _PATIENCE_S
            return is_alone.is_set() or (has_ended.is_set() and forsaken)

        page.run(is_unwanted)


def _listen(has_ended: Event, is_alone: Event) -> None:
    for line in sys.stdin:
        if line.strip() == "ended":
            has_ended.set()
    is_alone.set()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))

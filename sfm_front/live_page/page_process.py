"""The page of ``reconstruct --viewer``, in a process of its own: OUTPUT PORT.

It prints its address. Its session says ``ended`` on standard input when all is written: then the
page stays while a browser shows it. So it does, for a while, when the session's process is killed:
who looks at it shall read so.
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
# Nobody has a terminal any more to end it from.
_ORPHAN_S = 600.0
_NICE = 10


def main(output: Path, port: int) -> None:
    """Serve the page until it is no longer wanted."""
    let_others_first(_NICE)
    has_ended, is_alone = Event(), Event()
    Thread(target=_listen, args=(has_ended, is_alone), daemon=True).start()
    last_seen_s, orphaned_s = float("-inf"), float("inf")

    with LivePage(output, port) as page:
        # pycolmap would write a page of its own.
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        print(page.address, flush=True)

        def is_unwanted() -> bool:
            nonlocal last_seen_s, orphaned_s
            now_s = time.monotonic()
            if page.num_browsers:
                last_seen_s = now_s
            if is_alone.is_set():
                orphaned_s = min(orphaned_s, now_s)
            is_over = has_ended.is_set() or is_alone.is_set()
            is_forsaken = now_s - last_seen_s > _PATIENCE_S
            return (is_over and is_forsaken) or now_s - orphaned_s > _ORPHAN_S

        page.run(is_unwanted)


def _listen(has_ended: Event, is_alone: Event) -> None:
    for line in sys.stdin:
        if line.strip() == "ended":
            has_ended.set()
    is_alone.set()


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))

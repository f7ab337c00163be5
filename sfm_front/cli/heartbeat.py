"""Shows that a long step is still under way, from a process of its own.

COLMAP's adjustments can take minutes and hold the interpreter's lock meanwhile: no thread of the
process that runs them could print anything. This one repeats what was said last, with the time
that has passed since. Run as a script it is that process, and imports only what Python ships.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from subprocess import DEVNULL, PIPE, Popen
from typing import TextIO

_ON_TERMINAL_S = 1.0
# Photos that take less are no news.
_SILENCE_S = 2.0
# A line each time, in a log.
_ELSEWHERE_S = 60.0


class Heartbeat:
    """Repeats on a stream what was said last, until it is stopped or its process ends.

    On a terminal each second on the same line, elsewhere a line a minute.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._process: Popen[bytes] | None = None

    def say(self, text: str, *, is_long: bool = False) -> None:
        """``text`` stands in the line now; ``is_long``: worth a line a minute in a log, too."""
        if self._process is None:
            self._process = _start(self._stream)
        if self._process is None or self._process.stdin is None:
            return
        # Somebody may have ended it, which costs the heartbeat and nothing else.
        with suppress(OSError):
            self._process.stdin.write(json.dumps([text, is_long]).encode() + b"\n")
            self._process.stdin.flush()

    def stop(self) -> None:
        """Nothing is repeated any more once this returns."""
        if self._process is not None:
            with suppress(OSError):
                self._process.communicate()
            self._process = None


def _start(stream: TextIO) -> Popen[bytes] | None:
    """None if the stream is no file, or no process can be had."""
    try:
        return Popen(
            [sys.executable, "-I", "-S", __file__, stream.encoding],
            stdin=PIPE,
            stdout=stream.fileno(),
            stderr=DEVNULL,
        )
    except (OSError, ValueError):
        return None


def _clock(seconds: float) -> str:
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes}:{rest:02d}"


def _beat(encoding: str) -> None:
    """Until standard input ends."""
    # Ctrl-C may ask the run to finish. Ctrl-Z stops both, for they are one job of the shell.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    on_terminal = os.isatty(1)
    every_s = _ON_TERMINAL_S if on_terminal else _ELSEWHERE_S
    ended, said = threading.Event(), threading.Event()
    text, is_long, since = "", False, 0.0

    def listen() -> None:
        nonlocal text, is_long, since
        for line in sys.stdin.buffer:
            text, is_long = json.loads(line)
            since = time.monotonic()
            said.set()
        ended.set()
        said.set()

    threading.Thread(target=listen, daemon=True).start()
    while True:
        said.clear()
        if ended.is_set():
            return
        if said.wait(every_s) or not (text and (on_terminal or is_long)):
            continue
        seconds = time.monotonic() - since
        if seconds < _SILENCE_S:
            continue
        passed, shown = f" … {_clock(seconds)}", text
        if on_terminal:
            with suppress(OSError):
                shown = text[: (os.get_terminal_size(1).columns or 80) - 1 - len(passed)]
            line = f"\r\x1b[K{shown}{passed}"
        else:
            line = f"{text}{passed}\n"
        try:
            os.write(1, line.encode(encoding, "replace"))
        except OSError:
            return


if __name__ == "__main__":
    _beat(sys.argv[1])

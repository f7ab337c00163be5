"""Standard output and error that cost no run: where they cannot write, the run goes on."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from typing import Any, TextIO

# The reader went away, or the terminal was closed: that is nothing to tell.
_GONE = (errno.EPIPE, errno.EIO)


@contextmanager
def unfailing_streams() -> Iterator[Callable[[], OSError | None]]:
    """Until its end, printing never raises.

    Characters that the encoding has not are replaced, and once writing has failed, nothing more is
    written. Yields a function: why standard output is incomplete; None if it is complete, or if
    nobody was there to read on.
    """
    with ExitStack() as until_end:
        output, stdout = _unfailing(sys.stdout, "replace")
        _, stderr = _unfailing(sys.stderr, "backslashreplace")
        for stream, redirect in ((stdout, redirect_stdout), (stderr, redirect_stderr)):
            until_end.enter_context(redirect(stream))
            until_end.callback(stream.flush)

        def why_incomplete() -> OSError | None:
            stdout.flush()
            error = None if output is None else output.error
            return None if error is None or error.errno in _GONE else error

        yield why_incomplete


class _UnfailingFile(io.FileIO):
    """``error``: what the first failure was."""

    error: OSError | None = None

    def write(self, data: Any, /) -> int:
        if self.error is None:
            try:
                return super().write(data)
            except OSError as error:
                self.error = error
        return len(data)


def _unfailing(stream: TextIO | None, errors: str) -> tuple[_UnfailingFile | None, TextIO]:
    """The stream's file and a stream that writes to it; no file where it has none."""
    if stream is None:  # It was closed before Python began.
        return None, open(os.devnull, "w")  # noqa: PTH123
    try:
        file = _UnfailingFile(stream.fileno(), "wb", closefd=False)
    except (OSError, ValueError):  # Of a test, or of a program that calls this one.
        return None, stream
    return file, io.TextIOWrapper(
        io.BufferedWriter(file),
        encoding=stream.encoding,
        errors=errors,
        line_buffering=bool(stream.line_buffering),
    )

"""Read a file that may hang, as on a network mount whose server is gone, and give up in time."""

from __future__ import annotations

import stat
from collections.abc import Callable
from concurrent.futures import Future, wait
from pathlib import Path
from threading import Thread
from typing import BinaryIO, TypeVar

Result = TypeVar("Result")

READ_TIMEOUT_S = 60.0


def read_within(seconds: float, path: Path, read: Callable[[BinaryIO], Result]) -> Result:
    """What ``read`` makes of the open file, or raises.

    Raises TimeoutError after ``seconds``, and OSError or ValueError if the file cannot be opened
    or is no regular file. A call that hangs in the operating system cannot be ended: its thread
    stays behind, as a daemon, so that the process can end without it.
    """
    future: Future[Result] = Future()

    def run() -> None:
        try:
            # Opening a pipe would wait for ever, so anything that is no file is refused first.
            if not stat.S_ISREG(path.stat().st_mode):
                raise OSError("not a regular file")
            with path.open("rb") as file:
                future.set_result(read(file))
        except BaseException as error:  # Whatever it is, it belongs to the caller.
            future.set_exception(error)

    Thread(target=run, name="sfm-read", daemon=True).start()
    wait([future], seconds)
    if not future.done():
        raise TimeoutError(f"no answer within {seconds:g} s")
    return future.result()

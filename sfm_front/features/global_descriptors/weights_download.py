"""Download an official weights file once, into torch.hub's cache folder."""

from __future__ import annotations

import hashlib
import http.client
import logging
import os
import queue
import tempfile
import threading
import urllib.parse
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import IO

from sfm_front.errors import WeightsError

CONNECT_TIMEOUT_S = 3.0
STALL_TIMEOUT_S = 20.0
CHUNK_BYTES = 1 << 20

Progress = Callable[[int, int], None]
"""Called with the bytes received and the bytes expected (0 if the server does not say)."""

_log = logging.getLogger(__name__)


def checkpoint_folder() -> Path:
    """``$TORCH_HOME/hub/checkpoints``, found by torch's rule without importing torch."""
    cache_home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    torch_home = os.environ.get("TORCH_HOME") or f"{cache_home}/torch"
    return Path(torch_home).expanduser() / "hub" / "checkpoints"


def cached_or_fetched(url: str, *, progress: Progress | None = None) -> Path:
    """The file at ``url``: from the cache if complete there, else downloaded into it.

    The file name ends in the first digits of the file's SHA-256, as in ``resnet101-63fe2227.pth``,
    and a file that does not match them is never used. No partial file ever has that name.

    Raises:
        WeightsError: it is not cached and cannot be downloaded. An unreachable server costs at
            most ``CONNECT_TIMEOUT_S``.
    """
    path = checkpoint_folder() / file_name(url)
    try:
        if path.is_file() and _is_whole(path, url):
            return path
        _log.info("fetching %s", url)
        _download(url, path, progress)
    except (OSError, http.client.HTTPException) as error:
        reason = getattr(error, "reason", None) or error
        raise WeightsError(
            f"{path.name} is not in {path.parent} and cannot be downloaded ({reason}). "
            f"Put {url} there, or give a file with --weights."
        ) from error
    return path


def file_name(url: str) -> str:
    """The last part of ``url``."""
    return Path(urllib.parse.urlsplit(url).path).name


def hash_prefix(url: str) -> str:
    """The first digits of the SHA-256 of the file at ``url``, which its name ends in."""
    return Path(file_name(url)).stem.rsplit("-", 1)[-1]


def sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


def _is_whole(path: Path, url: str) -> bool:
    return sha256(path).startswith(hash_prefix(url))


def _download(url: str, path: Path, progress: Progress | None) -> None:
    """Download ``url`` to a temporary file, check it, and rename it to ``path``."""
    response, expected = _open(url)
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(prefix=f"{path.name}.", suffix=".part", dir=path.parent)
    partial = Path(name)
    try:
        received = 0
        with response, os.fdopen(descriptor, "wb") as file:
            while chunk := response.read(CHUNK_BYTES):
                file.write(chunk)
                received += len(chunk)
                if progress is not None:
                    progress(received, expected)
        if not _is_whole(partial, url):
            raise OSError(f"the SHA-256 of {received} bytes is not {hash_prefix(url)}…")
        # mkstemp's files are readable by their owner only; a cache may be shared.
        partial.chmod(0o644)
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def _open(url: str) -> tuple[IO[bytes], int]:
    """The response and its length, or an error within ``CONNECT_TIMEOUT_S``.

    In its own thread, because a socket's timeout covers neither the name look-up nor further
    addresses tried after the first.
    """
    outcome: queue.SimpleQueue[tuple[IO[bytes], int] | Exception] = queue.SimpleQueue()

    def work() -> None:
        try:
            response = urllib.request.urlopen(url, timeout=STALL_TIMEOUT_S)
            outcome.put((response, int(response.headers.get("Content-Length") or 0)))
        except Exception as error:  # raised in the waiting thread
            outcome.put(error)

    threading.Thread(target=work, name="weights-connect", daemon=True).start()
    try:
        result = outcome.get(timeout=CONNECT_TIMEOUT_S)
    except queue.Empty:
        host = urllib.parse.urlsplit(url).netloc
        raise TimeoutError(f"{host} did not answer within {CONNECT_TIMEOUT_S:g} s") from None
    if isinstance(result, Exception):
        raise result
    return result

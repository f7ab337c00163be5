"""Where the workers are, and how the work is cut for them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib.util import find_spec

from sfm_front.errors import ConfigError, DependencyError

_LOCAL = re.compile(r"local:(\d+)")
_REMOTE = re.compile(r"(tcp|tls)://.+:\d+")


@dataclass(frozen=True, kw_only=True)
class ClusterOptions:
    """``address``: ``local:N`` for N workers on this machine, or that of a Dask scheduler."""

    address: str
    # Photos of a group, whose models are grown by one worker.
    group_size: int = 300
    # Photos beyond its own that a group has of its neighbours, as a share of its own: by these its
    # model is joined to theirs.
    overlap: float = 0.25
    # Photos of one task: it should take seconds.
    batch_size: int = 8
    # How often a task is tried.
    attempts: int = 3

    def __post_init__(self) -> None:
        if not _LOCAL.fullmatch(self.address) and not _REMOTE.fullmatch(self.address):
            raise ConfigError(f"--cluster must be local:N or tcp://HOST:PORT, got {self.address!r}")
        if self.num_local == 0:
            raise ConfigError("--cluster local:N needs at least one worker")
        if self.group_size < 10:
            raise ConfigError(f"group_size must be at least 10, got {self.group_size}")
        if not 0 <= self.overlap <= 1:
            raise ConfigError(f"overlap must be from 0 to 1, got {self.overlap}")
        for name in ("batch_size", "attempts"):
            if getattr(self, name) < 1:
                raise ConfigError(f"{name} must be at least 1, got {getattr(self, name)}")

    @property
    def num_local(self) -> int | None:
        """Workers to start on this machine; None for a scheduler that runs already."""
        found = _LOCAL.fullmatch(self.address)
        return None if found is None else int(found[1])


def check_installed() -> None:
    """Raises DependencyError, in one line, if the extra is not."""
    missing = [name for name in ("dask", "distributed", "pymetis") if find_spec(name) is None]
    if missing:
        raise DependencyError(
            f"a cluster needs {', '.join(missing)}: pip install 'sfm-front[cluster]'"
        )

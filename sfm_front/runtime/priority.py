"""How much of the processor's time a process takes while others want it, too."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

_AUTOGROUP = Path("/proc/self/autogroup")


def let_others_first(nice: int) -> None:
    """Lower this process's priority, to a ``nice`` of 1 to 19 more than it has; where the system
    cannot do that, nothing happens.

    Linux shares the processor between sessions of processes before it looks at priorities
    (``sched_autogroup``): a process that was started with ``start_new_session`` would get as much
    as all of its parent's together, however nice it is. So that of its session is lowered, too,
    unless others belong to it.
    """
    if not hasattr(os, "nice"):  # Windows
        return
    with suppress(OSError):
        os.nice(nice)
    if os.getsid(0) == os.getpid():
        with suppress(OSError):  # There is no such file on other systems.
            _AUTOGROUP.write_text(str(nice))

"""How a module of this package is run in a process of its own."""

from __future__ import annotations

import os
import sys
from pathlib import Path

_PACKAGE_ROOT = Path(__file__).resolve().parents[2]


# As ``-m``, which however looks for modules in the working folder first: a file called json.py
# there, beside somebody's photos, would run.
_RUN = (
    "import sys; del sys.path[0]; import runpy; "
    "runpy.run_module(sys.argv.pop(1), None, '__main__', True)"
)


def module_command(module: str, *arguments: str) -> list[str]:
    """Runs a module as a program in ``module_environment``, whatever the working folder holds."""
    return [sys.executable, "-c", _RUN, module, *arguments]


def module_environment() -> dict[str, str]:
    """This process's environment, in which modules of this package are found uninstalled, too."""
    environment = dict(os.environ)
    search = [str(_PACKAGE_ROOT), *filter(None, [environment.get("PYTHONPATH")])]
    environment["PYTHONPATH"] = os.pathsep.join(search)
    # Else there is no working folder to be taken out of the search.
    environment.pop("PYTHONSAFEPATH", None)
    return environment

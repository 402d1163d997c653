"""Child processes: they run modules of this program, never of the current folder."""

import os
import sys
from pathlib import Path

_ROOT = str(Path(__file__).parents[1])


def own_module(module: str) -> list[str]:
    """The words with which the module `module` is run in a process that has `own_environment`."""
    return [sys.executable, "-P", "-m", module]


def own_environment() -> dict[str, str]:
    """The environment of this process, with its modules to be found and without the current folder among them."""
    named = [folder for folder in os.environ.get("PYTHONPATH", "").split(os.pathsep) if folder]
    return {**os.environ, "PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(dict.fromkeys([*named, _ROOT]))}

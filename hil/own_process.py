"""Processes of this program's own: its modules, never those of the folder that a user happens to stand in."""

import os
import sys
from multiprocessing import parent_process
from pathlib import Path
from threading import Thread

_ROOT = str(Path(__file__).parents[1])


def own_module(module: str) -> list[str]:
    """The words with which the module `module` is run in a process that has `own_environment`."""
    return [sys.executable, "-P", "-m", module]


def own_environment() -> dict[str, str]:
    """The environment of this process, with its modules to be found and without the current folder among them."""
    named = [folder for folder in os.environ.get("PYTHONPATH", "").split(os.pathsep) if folder]
    return {**os.environ, "PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(dict.fromkeys([*named, _ROOT]))}


def end_with_parent() -> None:
    """End this process with its parent: of one that was killed a child would wait for work for ever."""

    def watch() -> None:
        parent = parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    Thread(target=watch, daemon=True).start()

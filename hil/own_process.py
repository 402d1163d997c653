"""This program's version, and its child processes, which run its modules, never those of the current folder."""

import os
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_ROOT = str(Path(__file__).parents[1])


def own_module(module: str) -> list[str]:
    """The words with which the module `module` is run in a process that has `own_environment`."""
    return [sys.executable, "-P", "-m", module]


def own_environment() -> dict[str, str]:
    """The environment of this process, with its modules to be found and without the current folder among them."""
    named = [folder for folder in os.environ.get("PYTHONPATH", "").split(os.pathsep) if folder]
    return {**os.environ, "PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(dict.fromkeys([*named, _ROOT]))}


def version_of(package: str = "capsule-control") -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def error_text(error: BaseException, most: int = 200) -> str:
    """The text of an error in one line of at most `most` characters, or its type where it has none."""
    return " ".join(str(error).split())[:most] or type(error).__name__

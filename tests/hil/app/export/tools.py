"""Compilers and analysers that tests of exported C call; each test skips with a reason where one is missing."""

import ctypes
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-ffp-contract=off")


def tool(name: str) -> str:
    """The path of a program; skips the test where there is none."""
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


def done(command: Sequence[str | Path], folder: Path, seconds: float = 300.0) -> str:
    """What a command prints; fails the test where its status is not 0."""
    env = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}  # cppcheck's addons
    words = [str(word) for word in command]
    run = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=seconds, env=env, check=False)
    assert run.returncode == 0, f"{' '.join(map(str, command))}\n{run.stdout[-3000:]}{run.stderr[-3000:]}"
    return run.stdout + run.stderr


def compiled(cc: str, out: Path, sources: Sequence[Path], *include: Path, more: Sequence[str] = ()) -> ctypes.CDLL:
    """A shared library of C sources, without warnings."""
    places = [f"-I{path}" for path in include]
    done([cc, *WARNINGS, "-O1", "-shared", "-fPIC", *more, "-o", out, *sources, *places, "-lm"], out.parent)
    return ctypes.CDLL(str(out))

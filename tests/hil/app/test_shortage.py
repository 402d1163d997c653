"""Too little memory or too few open files end with a sentence that says so."""

import errno
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from hil.app.system import LEAST_FILES, LEAST_MEMORY, shortage
from hil.app.write import file_trouble
from tests.places import ROOT

CAPSULE = [sys.executable, "-m", "hil.app.start"]


def limited(what: int, to: int) -> Callable[[], None]:
    return lambda: resource.setrlimit(what, (to, to))


@pytest.mark.parametrize(
    ("what", "to", "sentence"),
    [
        (
            resource.RLIMIT_AS,
            700 << 20,
            "capsule: memory must be at least 1048576 kB (ulimit -v); got a limit of 716800 kB",
        ),
        (resource.RLIMIT_NOFILE, 12, "capsule: open files must be at least 32 (ulimit -n); got a limit of 12"),
    ],
)
def test_a_command_is_not_begun(tmp_path: Path, what: int, to: int, sentence: str) -> None:
    found = subprocess.run(
        [*CAPSULE, "sil", str(tmp_path / "none.toml")],
        check=False,
        capture_output=True,
        text=True,
        preexec_fn=limited(what, to),
        cwd=ROOT,
    )
    assert (found.returncode, found.stderr) == (2, sentence + "\n")


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.EMFILE, "Too many open files"), "open files must be enough"),
        (OSError(errno.ENFILE, "Too many open files in system"), "open files must be enough"),
        (OSError("x.so: cannot open shared object file: Too many open files"), "open files must be enough"),
        (OSError(errno.ENOMEM, "Cannot allocate memory", "x"), "memory must be enough"),
        (MemoryError(), "memory must be enough"),
        (ImportError("x.so: failed to map segment from shared object"), "memory must be enough"),
        (OSError("Could not find/load shared object file 'libllvmlite.so'"), "memory must be enough"),
        (OSError(errno.ENOSPC, "No space left on device", "x"), ""),
        (ImportError("No module named 'x'"), ""),
    ],
)
def test_what_there_was_too_little_of(error: Exception, words: str) -> None:
    assert shortage(error).startswith(words)
    assert bool(shortage(error)) == bool(words)


def test_what_the_system_refused_names_no_file_where_there_is_none() -> None:
    assert file_trouble(OSError(errno.ENOSPC, "No space left on device", "x")).startswith("x must be one that")
    assert file_trouble(OSError(errno.ENOENT, "No usable temporary directory found in ['/tmp']")) == (
        "the system must grant what the command needs; got: No usable temporary directory found in ['/tmp']"
    )
    assert "limit of" in file_trouble(OSError(errno.EMFILE, "Too many open files"))
    assert resource.getrlimit(resource.RLIMIT_NOFILE)[0] > LEAST_FILES
    assert LEAST_MEMORY <= 1 << 30

"""What the system gives a process too little of; a file of its own so that nothing else is loaded before."""

import errno
import resource
from collections.abc import Sequence
from typing import Final

LEAST_MEMORY: Final = 1 << 30
"""Bytes of address space without which libraries end in the middle of being loaded, some of them without a word."""
LEAST_FILES: Final = 32  # open files that the program needs
_ENDLESS: Final = 1 << 62  # bytes: a limit beyond is none
_MANY: Final = (errno.EMFILE, errno.ENFILE)
_FULL: Final = ("failed to map segment", "annot allocate memory", "Could not find/load shared object")
"""How loaders and libraries say that there is no memory to put a library into."""


def too_little(arguments: Sequence[str]) -> str:
    """Why a command cannot be begun, "" where it can; help needs nothing."""
    if not arguments or {"--help", "--version"} & set(arguments):
        return ""
    memory, files = _limit(resource.RLIMIT_AS), _limit(resource.RLIMIT_NOFILE)
    if memory < LEAST_MEMORY:
        return f"memory must be at least {LEAST_MEMORY >> 10} kB (ulimit -v); got a limit of {memory >> 10} kB"
    if files < LEAST_FILES:
        return f"open files must be at least {LEAST_FILES} (ulimit -n); got a limit of {files}"
    return ""


def shortage(error: BaseException) -> str:
    """What there was too little of where `error` came of that, else ""."""
    number, words = getattr(error, "errno", None), str(error)
    if number in _MANY or "Too many open files" in words:
        return f"open files must be enough for the command (ulimit -n); got a limit of {_limit(resource.RLIMIT_NOFILE)}"
    if number == errno.ENOMEM or isinstance(error, MemoryError) or any(part in words for part in _FULL):
        limit = _limit(resource.RLIMIT_AS)
        got = f"a limit of {limit >> 10} kB (ulimit -v)" if limit < _ENDLESS else "no more of the machine's"
        return f"memory must be enough for the command; got {got}"
    return ""


def _limit(what: int) -> int:
    soft = resource.getrlimit(what)[0]
    return _ENDLESS if soft == resource.RLIM_INFINITY else soft

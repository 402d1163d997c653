"""The files of a log and its record: names, exclusive use by one run, and checks at the end."""

import fcntl
import json
import os
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any, Final

from hil.log.blf_file import whole

FORMAT: Final = 2  # of the record beside a log
_MOST_NAMES: Final = 1000  # that are tried for a new log


def record_path(path: Path) -> Path:
    """The path of the record of the log `path`."""
    return path.with_suffix(".json")


def cannot_write(path: Path, error: OSError) -> ValueError:
    return ValueError(f"{path}: log must be a file that can be written; got: {error.strerror or error}")


def free_name(path: Path, ending: str, first: int) -> Path:
    """The first free name beside `path` by the numbers from `first` on in `ending`, as "-{}"; also for its record."""
    names = (path.with_name(f"{path.stem}{ending.format(number)}{path.suffix}") for number in count(first))
    return next(name for name in names if not name.exists() and not record_path(name).exists())


def keep_older(path: Path) -> Path | None:
    """Move a log at `path` and its record to the first free name `NAME-1.blf`, ...; returns that name."""
    if not path.exists():
        return None
    kept = free_name(path, "-{}", 1)
    try:
        path.rename(kept)
        if record_path(path).exists():
            record_path(path).rename(record_path(kept))
    except OSError as error:
        raise ValueError(f"{path}: older log must be one that can be moved; got: {error.strerror or error}") from None
    return kept


def claim(path: Path) -> tuple[int, Path, Path | None]:
    """Claim a log's file for this run: its lock, its name (`NAME-run2.blf`, ... if another run writes to `path`), and
    the new name of an older log (`keep_older`). Raises ValueError.
    """
    check_regular(path)
    kept: Path | None = None
    number, wanted = 1, path
    for _ in range(_MOST_NAMES):
        try:
            lock = os.open(wanted, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
            if _locked(lock, wanted):
                return lock, wanted, kept
            os.close(lock)
        except FileExistsError:
            lock = os.open(wanted, os.O_RDWR)
            if _locked(lock, wanted) and os.fstat(lock).st_size:
                kept = keep_older(wanted)
            else:
                number += 1
                wanted = path.with_name(f"{path.stem}-run{number}{path.suffix}")
            os.close(lock)
        except OSError as error:
            raise cannot_write(path, error) from None
    raise ValueError(f"{path}: log must have a name that is free; got {_MOST_NAMES} that are not")


def _locked(lock: int, path: Path) -> bool:
    """Lock the open file for this run; whether that succeeded and it is still the file at `path`."""
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return stands(lock, path)


def stands(lock: int, path: Path) -> bool:
    """Whether the open file is still the one at `path`."""
    try:
        return os.path.samestat(os.fstat(lock), path.stat())
    except OSError:
        return False


def missing(lock: int, path: Path) -> str:
    """What is wrong with the file of a finished log, "" if it is whole."""
    if not stands(lock, path):
        return "its file was taken away while the run went on; all its frames are missing"
    return "" if whole(path) else "its file was written to by another program; frames are missing"


def check_regular(path: Path) -> None:
    """Raises ValueError if `path` exists and is not a regular file."""
    if path.exists() and not path.is_file():
        got = "a folder" if path.is_dir() else "a device, a pipe or a socket"
        raise ValueError(f"{path}: log must be a regular file; got {got}")


def write_record(path: Path, record: Mapping[str, Any]) -> None:
    """Write the record of the log `path` atomically. Raises ValueError."""
    if path.suffix != ".blf":
        raise ValueError(f"log must be a file name that ends in .blf; got {path}")
    target = record_path(path)
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    text = json.dumps({"format": FORMAT, **record}, indent=2, sort_keys=True, allow_nan=False)
    try:
        temporary.write_text(text + "\n", encoding="utf-8")
        temporary.replace(target)
    except OSError as error:
        raise cannot_write(path, error) from None

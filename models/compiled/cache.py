"""Where compiled code is kept; folders that are the user's own, closed to everybody else."""

import atexit
import os
import shutil
import stat
import sys
import tempfile
from functools import cache
from pathlib import Path


def cache_folder() -> Path:
    """`CAPSULE_CACHE`, else the user's cache folder. Where that is not the user's alone or cannot be written
    to, one of this process that goes with it; said once on standard error.
    """
    return _folder(
        os.environ.get("CAPSULE_CACHE")
        or os.path.join(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "capsule")
    )


@cache
def _folder(root: str) -> Path:
    try:
        folder = private_folder(Path(root))
        if os.access(folder, os.W_OK):
            return folder
        why = "it cannot be written to"
    except OSError as error:
        why = error.strerror or str(error)
    print(f"compiled code is not kept in {root}: {why}", file=sys.stderr)
    folder = Path(tempfile.mkdtemp(prefix="capsule-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def private_folder(path: Path) -> Path:
    """Make the folder `path` for its owner alone. Raises OSError where it is another's, a link, or writable by others:
    what lies in it may then not be ours.
    """
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode):
        raise PermissionError(0, "it must be a folder, not a link", str(path))
    if found.st_uid != os.geteuid():
        raise PermissionError(0, f"it must belong to user {os.geteuid()}; got {found.st_uid}", str(path))
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(0, "nobody else must be able to write to it: chmod go-w", str(path))
    return path

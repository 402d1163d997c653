"""Folders for what is run or spoken to later: the user's own, closed to everybody else."""

import os
import stat
from pathlib import Path


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

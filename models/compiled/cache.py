"""Where compiled code is kept."""

import atexit
import os
import shutil
import sys
import tempfile
from functools import cache
from pathlib import Path

from models.compiled.private_folder import private_folder


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

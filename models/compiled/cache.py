"""Generated source code as modules, kept on disk beside what numba compiles of it."""

from __future__ import annotations

import atexit
import hashlib
import importlib.util
import os
import shutil
import sys
import tempfile
import threading
from functools import cache
from pathlib import Path
from typing import Any

from models.compiled.private_folder import private_folder
from models.files.writing import writing

_LOADING = threading.Lock()


def cache_folder() -> Path:
    """Where generated code is kept: `CAPSULE_CACHE`, else the user's cache folder. Where that is not the user's alone
    or cannot be written to, one of this process that goes with it; said once on standard error.
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


def load(source: str) -> Any:
    """Generated `source` as a module, kept on disk under its hash beside what numba compiles of it."""
    with _LOADING:
        return _loaded(source)


def _loaded(source: str) -> Any:
    name = "capsule_step_" + hashlib.sha256((source + sys.version).encode()).hexdigest()[:20]
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
    if not path.is_file() or path.read_bytes() != source.encode():
        draft = path.with_suffix(f".{os.getpid()}")
        with writing(path):
            draft.write_bytes(source.encode())
            os.replace(draft, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module

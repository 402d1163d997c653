"""Generated source code as modules, kept on disk beside what numba compiles of it."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

_LOADING = threading.Lock()


def cache_folder() -> Path:
    """Where generated code is kept: `CAPSULE_CACHE`, else the user's cache folder, else the one for temporary files."""
    root = os.environ.get("CAPSULE_CACHE") or os.path.join(
        os.environ.get("XDG_CACHE_HOME", os.path.expanduser("~/.cache")), "capsule"
    )
    folder = Path(root)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if os.access(folder, os.W_OK):
            return folder
    except OSError:
        pass
    return Path(tempfile.gettempdir())


def load(source: str) -> Any:
    """Generated `source` as a module, kept on disk under its hash beside what numba compiles of it."""
    with _LOADING:
        return _loaded(source)


def _loaded(source: str) -> Any:
    name = "capsule_step_" + hashlib.sha256((source + sys.version).encode()).hexdigest()[:20]
    if name in sys.modules:
        return sys.modules[name]
    path = cache_folder() / f"{name}.py"
    if not path.is_file():
        draft = path.with_suffix(f".{os.getpid()}")
        draft.write_text(source, encoding="utf-8")
        os.replace(draft, path)
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module

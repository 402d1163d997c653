"""Which program made a row: its sources, the packages that matter, the effects and controllers of other packages."""

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

import controller.registry
import models.effects.own
from models.files.python_file import installed

_PACKAGES: Final = ("numpy", "scipy", "casadi", "daqp", "numba")
_ROOT: Final = Path(__file__).parents[2]
_FOLDERS: Final = ("controller", "models", "plant", "hil")


@cache
def program_version() -> str:
    """`0.2.0 sources 0123456789ab, numpy 2.2.1 ...`, then the hash of each installed effect and controller. Programs of
    one version give the same rows.
    """
    sources = hashlib.sha256()
    for path in sorted(path for folder in _FOLDERS for path in (_ROOT / folder).rglob("*.py")):
        sources.update(path.relative_to(_ROOT).as_posix().encode() + path.read_bytes())
    packages = " ".join(f"{name} {_number(name)}" for name in _PACKAGES)
    others = [
        f"{where} {digest[:12]}"
        for group, what in ((controller.registry.GROUP, "controllers"), (models.effects.own.GROUP, "effects"))
        for where, _, digest in installed(group, what)
    ]
    return ", ".join([f"{_number('capsule-control')} sources {sources.hexdigest()[:12]}", packages, *others])


def _number(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"

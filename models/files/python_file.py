"""A user's Python file: run once, and the classes that it declares."""

import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path

from models.files.access import LARGEST_TEXT, read_bytes


def installed(group: str, what: str) -> Iterator[tuple[str, type, str]]:
    """The classes that installed packages offer under the entry point `group`, each as its entry, the class, and the
    SHA-256 of its file. Raises ValueError where one cannot be loaded or is no class.
    """
    for point in entry_points(group=group):
        try:
            offered = point.load()
            if not isinstance(offered, type):
                raise TypeError(f"{type(offered).__name__}, not a class")
            source = Path(inspect.getfile(offered)).read_bytes()
        except (Exception, SystemExit) as error:  # noqa: BLE001 - another's package raises whatever it likes
            got = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
            rule = f"{what} of the installed package must be ones that load"
            raise ValueError(f"{group}: {rule}; got {point.value}: {got}") from None
        yield point.value, offered, hashlib.sha256(source).hexdigest()


def classes_in(path: Path, what: str) -> tuple[list[type], str]:
    """The classes that the Python file `path` declares itself, and the SHA-256 of the file. Raises ValueError, which
    names `what` the file should hold, where it cannot be read or run.
    """
    source = read_bytes(path, f"Python file with {what}", LARGEST_TEXT)
    digest = hashlib.sha256(source).hexdigest()
    name = f"capsule_own_{digest[:16]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if path.suffix != ".py" or spec is None or spec.loader is None:
        raise ValueError(f"{path}: {what} must come from a file whose name ends in .py; got {path.name!r}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        exec(compile(source, str(path), "exec"), vars(module))  # what the digest is of, and no older byte code
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a user's file raises whatever it likes
        del sys.modules[name]
        got = f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        raise ValueError(f"{path}: {what} must come from a file that Python can run; got {got}") from None
    return [c for c in vars(module).values() if isinstance(c, type) and c.__module__ == name], digest

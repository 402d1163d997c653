"""Effects from outside the project: classes in a user's file, or in an installed package under the entry point group
`capsule.effects`. Once loaded they take part like our own.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Iterator, MutableMapping, Sequence
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Final

from models.effects.conformance import first_failure
from models.effects.effect import Effect

GROUP: Final = "capsule.effects"
LARGEST_FILE: Final = 1 << 20


@dataclass(frozen=True)
class Origin:
    """Where an effect came from: a file's name (or a package's) and the SHA-256 of what it holds."""

    effect: type[Effect]
    file: str
    sha256: str


LOADED: Final[dict[str, Origin]] = {}
"""The effects from outside that are in use, by id."""


def use(paths: Sequence[Path], known: MutableMapping[str, type[Effect]]) -> list[type[Effect]]:
    """Put the effects of `paths` and of installed packages into `known` (ids to effects), in place of those that an
    earlier call put there; returns them.

    Raises ValueError, one sentence with the file, where one cannot be used; then none is in use.
    """
    forget(known)
    try:
        for origin in _found(paths):
            name = origin.effect.id
            if name in known:
                taken = LOADED[name].file if name in LOADED else "the catalogue"
                raise ValueError(f"{origin.file}: id must be one that is free; got {name!r}, which {taken} has")
            failure = first_failure(origin.effect, known)
            if failure is not None:
                raise ValueError(f"{origin.file}: {failure}")
            known[name] = origin.effect
            LOADED[name] = origin
    except ValueError:
        forget(known)
        raise
    return [origin.effect for origin in LOADED.values()]


def forget(known: MutableMapping[str, type[Effect]]) -> None:
    """Take the effects from outside out of `known` again."""
    for name in LOADED:
        known.pop(name, None)
    LOADED.clear()


def _found(paths: Sequence[Path]) -> Iterator[Origin]:
    for point in entry_points(group=GROUP):
        effect = point.load()
        source = inspect.getsource(effect)
        yield Origin(effect, point.value, hashlib.sha256(source.encode()).hexdigest())
    for path in paths:
        yield from effects_in(path)


def effects_in(path: Path) -> list[Origin]:
    """The effects that a Python file declares. Raises ValueError of one sentence where it cannot be run or has none."""
    try:
        if not path.is_file() or path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"{path}: effects must come from a file smaller than {LARGEST_FILE} bytes; got none")
        data = path.read_bytes()
    except OSError as error:
        raise ValueError(f"{path}: effects must come from a file that can be read; got: {error.strerror}") from None
    digest = hashlib.sha256(data).hexdigest()
    name = f"capsule_own_{digest[:16]}"
    spec = importlib.util.spec_from_file_location(name, path)
    if path.suffix != ".py" or spec is None or spec.loader is None:
        raise ValueError(f"{path}: effects must come from a file whose name ends in .py; got {path.name!r}")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - a user's file raises whatever it likes
        del sys.modules[name]
        words = " ".join(str(error).split())[:200]
        raise ValueError(
            f"{path}: effects must come from a file that Python can run; got {type(error).__name__}: {words}"
        ) from None
    classes = [
        c for c in vars(module).values() if isinstance(c, type) and issubclass(c, Effect) and c.__module__ == name
    ]
    if not classes:
        raise ValueError(f"{path}: file must have a subclass of models.effects.effect.Effect; got none")
    return [Origin(c, path.name, digest) for c in classes]

"""Effects from outside the project: classes in a user's file, or in an installed package under the entry point group
`capsule.effects`. Once loaded they take part like our own.
"""

from collections.abc import Collection, Container, Iterator, MutableMapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from models.effects.conformance import first_failure
from models.effects.effect import Effect
from models.files.python_file import classes_in, installed

GROUP: Final = "capsule.effects"


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
        found = list(_found(paths))
        ids = {*known, *(origin.effect.id for origin in found if isinstance(origin.effect.id, str))}
        for origin in found:
            name = origin.effect.id
            if isinstance(name, str) and name in known:
                taken = LOADED[name].file if name in LOADED else "the catalogue"
                raise ValueError(f"{origin.file}: id must be one that is free; got {name!r}, which {taken} has")
            failure = own_failure(origin.effect, ids)
            if failure is not None:
                raise ValueError(f"{origin.file}: {failure}")
            known[name] = origin.effect
            LOADED[name] = origin
    except ValueError:
        forget(known)
        raise
    return [origin.effect for origin in LOADED.values()]


def own_failure(effect: type[Effect], known: Collection[str]) -> str | None:
    """The first rule that an effect from outside breaks, in a sentence; `known` are the ids in use."""
    if isinstance(effect.kinds, Container) and "vibro_table" in effect.kinds:
        return f"{effect.__name__}.kinds must not have 'vibro_table', whose solver has its own effects"
    return first_failure(effect, known)


def forget(known: MutableMapping[str, type[Effect]]) -> None:
    """Take the effects from outside out of `known` again."""
    for name in LOADED:
        known.pop(name, None)
    LOADED.clear()


def _found(paths: Sequence[Path]) -> Iterator[Origin]:
    for where, cls, digest in installed(GROUP, "effects"):
        if not issubclass(cls, Effect):
            raise ValueError(f"{where}: class must be a subclass of models.effects.effect.Effect; got {cls.__name__}")
        yield Origin(cls, where, digest)
    for path in paths:
        yield from effects_in(path)


def effects_in(path: Path) -> list[Origin]:
    """The effects that a Python file declares. Raises ValueError of one sentence where it cannot be run or has none."""
    declared, digest = classes_in(path, "effects")
    classes = [c for c in declared if issubclass(c, Effect) and (c.id or not c.__subclasses__())]
    if not classes:
        raise ValueError(f"{path}: file must have a subclass of models.effects.effect.Effect; got none")
    return [Origin(c, path.name, digest) for c in classes]
